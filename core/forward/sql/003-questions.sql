-- Views and functions of a time for the questions of a plant: how a plate was bent, and how presses and crews compare. Baselines and trials do not count as strokes.

CREATE VIEW platen.bend_made AS
SELECT s.site, s.press, s.owner, s.plate, s.run_id, s.accepted, b.n::int AS n, (b.of->'at_mm'->>0)::float8 AS u_mm,
    (b.of->'at_mm'->>1)::float8 AS v_mm, (b.of->>'angle_deg')::float8 AS angle_deg, (b.of->>'direction_deg')::float8 AS direction_deg,
    (b.of->>'length_mm')::float8 AS length_mm, (b.of->>'width_mm')::float8 AS width_mm
FROM platen.stroke s CROSS JOIN LATERAL jsonb_array_elements(s.bends) WITH ORDINALITY AS b (of, n)
WHERE NOT s.dry_run;

-- Each bend, with whether it lies on an earlier one of its plate: directions less than 20 degrees apart, bands that overlap by their centres.
CREATE VIEW platen.bend AS
SELECT b.*, EXISTS (
    SELECT FROM platen.bend_made e
    WHERE e.site = b.site AND e.press = b.press AND e.owner = b.owner AND e.plate = b.plate AND e.run_id < b.run_id
        AND abs(mod((b.direction_deg - e.direction_deg + 450)::numeric, 180) - 90) < 20
        AND abs(cosd(b.direction_deg) * (e.v_mm - b.v_mm) - sind(b.direction_deg) * (e.u_mm - b.u_mm)) < least(b.width_mm, e.width_mm) / 2
        AND abs(cosd(b.direction_deg) * (e.u_mm - b.u_mm) + sind(b.direction_deg) * (e.v_mm - b.v_mm)) < (b.length_mm + e.length_mm) / 2
) AS rehit
FROM platen.bend_made b;

-- Course of each plate that began in a time, to its first pass. A plate that never passed has neither strokes_to_pass nor minutes_to_pass. Strokes more
-- than 90 days after the time are not looked for, so that the months before and after it are not read.
CREATE FUNCTION platen.plate_courses(since timestamptz, until timestamptz)
RETURNS TABLE (site text, press text, owner int, plate bigint, part_id bigint, part_name text, recipe int, crew int, began timestamptz,
    last_stroke timestamptz, strokes bigint, not_measured bigint, overshoots bigint, passed timestamptz, strokes_to_pass int, minutes_to_pass float8)
LANGUAGE sql STABLE PARALLEL SAFE AS $$
    SELECT s.site, s.press, s.owner, s.plate, min(s.part_id), min(s.part_name), max(s.recipe), CASE WHEN min(s.crew) = max(s.crew) THEN max(s.crew) END,
        min(s.accepted), max(s.accepted), count(*), count(*) FILTER (WHERE s.verdict = 'not_measured'),
        count(*) FILTER (WHERE s.verdict = 'fail' AND s.sense > 0), min(s.accepted) FILTER (WHERE s.verdict = 'pass'),
        array_position(array_agg(s.verdict = 'pass' ORDER BY s.run_id), true),
        extract(epoch FROM min(s.accepted) FILTER (WHERE s.verdict = 'pass') - min(s.accepted))::float8 / 60
    FROM platen.plate p JOIN platen.stroke s ON s.site = p.site AND s.press = p.press AND s.owner = p.owner AND s.plate = p.plate
    WHERE p.began >= since AND p.began < until AND s.accepted >= since AND s.accepted < until + interval '90 days' AND NOT s.baseline AND NOT s.dry_run
    GROUP BY s.site, s.press, s.owner, s.plate
$$;
CREATE INDEX ON platen.plate (began);
CREATE VIEW platen.plate_course AS SELECT * FROM platen.plate_courses('-infinity', 'infinity');

-- Half the width of a 95 % interval of a mean of n values with this standard deviation. Quantile of Student's t by the expansion of Cornish and
-- Fisher, to 0.002 from n = 10 on (Abramowitz and Stegun, 26.7.5).
CREATE FUNCTION platen.interval_95(deviation float8, n bigint) RETURNS float8 LANGUAGE sql IMMUTABLE PARALLEL SAFE AS $$
    SELECT CASE WHEN n >= 10 THEN (1.95996 + 2.37227 / (n - 1) + 2.82250 / (n - 1) ^ 2) * deviation / sqrt(n) END
$$;

-- Plates of one recipe that began in a time and passed, for each press, or for each crew where the plant lets their codes leave the record; plates that two
-- crews bent are left out there. Fewer than 20 plates say nothing: at the usual scatter of a quarter, 20 plates tell a difference of 20 %. Plates of one
-- heat are alike, so that the intervals are too narrow where few heats were bent.
CREATE FUNCTION platen.compared(since timestamptz, until timestamptz, of_crews boolean)
RETURNS TABLE (site text, press text, crew int, recipe int, plates bigint, strokes_mean float8, strokes_low float8, strokes_high float8,
    minutes_median float8, overshoot_share float8, caveat text)
LANGUAGE sql STABLE PARALLEL SAFE AS $$
    SELECT c.site, c.press, c.crew, c.recipe, c.plates, c.strokes_mean, c.strokes_mean - c.half, c.strokes_mean + c.half, c.minutes_median,
        c.overshoot_share,
        CASE
            WHEN c.plates < 20 THEN 'fewer than 20 plates: no comparison'
            WHEN of_crews THEN 'a crew with hard plates is not a bad crew: platen history skill takes the hardness out'
            ELSE 'intervals take plates as independent; plates of one heat are not'
        END
    FROM (
        SELECT plate.site, CASE WHEN NOT of_crews THEN plate.press END AS press, CASE WHEN of_crews THEN plate.crew END AS crew, plate.recipe, count(*) AS plates,
            CASE WHEN count(*) >= 20 THEN avg(plate.strokes_to_pass)::float8 END AS strokes_mean,
            platen.interval_95(stddev_samp(plate.strokes_to_pass)::float8, count(*)) AS half,
            CASE WHEN count(*) >= 20 THEN percentile_cont(0.5) WITHIN GROUP (ORDER BY plate.minutes_to_pass) END AS minutes_median,
            CASE WHEN count(*) >= 20 THEN avg((plate.overshoots > 0)::int)::float8 END AS overshoot_share
        FROM platen.plate_courses(since, until) plate
        WHERE plate.strokes_to_pass IS NOT NULL AND (NOT of_crews OR plate.crew IS NOT NULL)
        GROUP BY 1, 2, 3, 4
    ) AS c
$$;

-- The sign of life of each press, without reading what it sent.
CREATE INDEX ON platen.inbox USING brin (at) WITH (autosummarize = on);

GRANT SELECT ON ALL TABLES IN SCHEMA platen TO platen_reader;
GRANT EXECUTE ON FUNCTION platen.interval_95, platen.plate_courses, platen.compared TO platen_reader;

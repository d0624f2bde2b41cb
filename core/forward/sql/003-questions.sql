-- Views for the questions of a plant: how a plate was bent, and how presses and crews compare. Baselines and trials do not count as strokes.

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

-- Strokes of a plate with what came before on it.
CREATE VIEW platen.plate_stroke AS
SELECT s.*, coalesce(bool_or(s.verdict = 'pass') OVER (so_far ROWS BETWEEN UNBOUNDED PRECEDING AND 1 PRECEDING), false) AS passed_before,
    bool_or(s.verdict = 'pass') OVER (PARTITION BY s.site, s.press, s.owner, s.plate) AS ever_passed
FROM platen.stroke s
WHERE NOT s.baseline AND NOT s.dry_run
WINDOW so_far AS (PARTITION BY s.site, s.press, s.owner, s.plate ORDER BY s.run_id);

-- Course of each plate to its first pass. A plate that never passed has neither strokes_to_pass nor minutes_to_pass.
CREATE VIEW platen.plate_course AS
SELECT s.site, s.press, s.owner, s.plate, min(s.part_id) AS part_id, min(s.part_name) AS part_name, max(s.recipe) AS recipe,
    CASE WHEN count(DISTINCT s.crew) = 1 THEN max(s.crew) END AS crew, min(s.accepted) AS began, max(s.accepted) AS last_stroke,
    count(*) AS strokes, count(*) FILTER (WHERE s.verdict = 'not_measured') AS not_measured,
    count(*) FILTER (WHERE s.verdict = 'fail' AND s.sense > 0) AS overshoots, min(s.accepted) FILTER (WHERE s.verdict = 'pass') AS passed,
    nullif(count(*) FILTER (WHERE s.ever_passed AND NOT s.passed_before), 0) AS strokes_to_pass,
    extract(epoch FROM min(s.accepted) FILTER (WHERE s.verdict = 'pass') - min(s.accepted))::float8 / 60 AS minutes_to_pass
FROM platen.plate_stroke s
GROUP BY s.site, s.press, s.owner, s.plate;

-- Bends and re-hits of each plate.
CREATE VIEW platen.plate_bends AS
SELECT b.site, b.press, b.owner, b.plate, count(*) AS bends, count(*) FILTER (WHERE b.rehit) AS rehits
FROM platen.bend b GROUP BY b.site, b.press, b.owner, b.plate;

-- Half the width of a 95 % interval of a mean of n values with this standard deviation. Quantile of Student's t by the expansion of Cornish and
-- Fisher, to 0.002 from n = 10 on (Abramowitz and Stegun, 26.7.5).
CREATE FUNCTION platen.interval_95(deviation float8, n bigint) RETURNS float8 LANGUAGE sql IMMUTABLE AS $$
    SELECT CASE WHEN n >= 10 THEN (1.95996 + 2.37227 / (n - 1) + 2.82250 / (n - 1) ^ 2) * deviation / sqrt(n) END
$$;

-- Plates of one recipe that passed, for each press and for each crew. Fewer than 20 plates say nothing: at the usual scatter of a quarter, 20 plates
-- tell a difference of 20 %.
CREATE VIEW platen.compared AS
SELECT c.site, c.of_crews, c.press, c.crew, c.recipe, c.plates, c.strokes_mean, c.strokes_mean - c.half AS strokes_low,
    c.strokes_mean + c.half AS strokes_high, c.minutes_median, c.overshoot_share,
    CASE WHEN c.plates < 20 THEN 'fewer than 20 plates: no comparison' END AS caveat
FROM (
    SELECT site, grouping(press) = 1 AS of_crews, press, crew, recipe, count(*) AS plates,
        CASE WHEN count(*) >= 20 THEN avg(strokes_to_pass)::float8 END AS strokes_mean,
        platen.interval_95(stddev_samp(strokes_to_pass)::float8, count(*)) AS half,
        CASE WHEN count(*) >= 20 THEN percentile_cont(0.5) WITHIN GROUP (ORDER BY minutes_to_pass) END AS minutes_median,
        CASE WHEN count(*) >= 20 THEN avg((overshoots > 0)::int)::float8 END AS overshoot_share
    FROM platen.plate_course WHERE strokes_to_pass IS NOT NULL
    GROUP BY GROUPING SETS ((site, press, recipe), (site, crew, recipe))
) AS c;

-- Presses compared. Plates of one heat are alike, so that the intervals are too narrow where few heats were bent.
CREATE VIEW platen.press_compared AS
SELECT site, press, recipe, plates, strokes_mean, strokes_low, strokes_high, minutes_median, overshoot_share,
    coalesce(caveat, 'intervals take plates as independent; plates of one heat are not') AS caveat
FROM platen.compared WHERE NOT of_crews;

-- Crews compared, where the plant lets their codes leave the record. Plates that two crews bent are left out.
CREATE VIEW platen.crew_compared AS
SELECT site, crew, recipe, plates, strokes_mean, strokes_low, strokes_high, minutes_median, overshoot_share,
    coalesce(caveat, 'a crew with hard plates is not a bad crew: platen history skill takes the hardness out') AS caveat
FROM platen.compared WHERE of_crews AND crew IS NOT NULL;

GRANT SELECT ON ALL TABLES IN SCHEMA platen TO platen_reader;
GRANT EXECUTE ON FUNCTION platen.interval_95 TO platen_reader;

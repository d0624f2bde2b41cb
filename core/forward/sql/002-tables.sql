-- Tables that people query, filled from the inbox by a trigger for each statement. `platen.rebuild()` fills them anew.

CREATE TABLE platen.plate (
    site      text NOT NULL,
    press     text NOT NULL,
    owner     int NOT NULL,
    plate     bigint NOT NULL,
    part_id   bigint,
    part_name text,
    began     timestamptz NOT NULL,
    ended     timestamptz,
    PRIMARY KEY (site, press, owner, plate)
);

-- One row a measurement. Partitions of a month, so that old months are read-only and leave without a trace.
CREATE TABLE platen.stroke (
    site               text NOT NULL,
    press              text NOT NULL,
    owner              int NOT NULL,
    run_id             bigint NOT NULL,
    accepted           timestamptz NOT NULL,
    scanned            timestamptz,
    finished           timestamptz,
    acked              timestamptz,
    ack                text,
    session            int,
    stroke             int,
    attempt            int,
    plate              bigint NOT NULL,
    part_id            bigint,
    part_name          text,
    recipe             int,
    baseline           boolean NOT NULL,
    dry_run            boolean NOT NULL,
    crew               int,
    verdict            text,
    reason             text,
    gap_max_mm         float8,
    gap_uncertainty_mm float8,
    -- 1: bent too far, -1: not far enough.
    sense              int,
    deviation_rms_mm   float8,
    deviation_max_mm   float8,
    deviation_min_mm   float8,
    coverage           float8,
    ram_depth_mm       float8,
    force_kn           float8,
    stroke_to_result_s float8,
    says               text,
    figures            jsonb,
    bends              jsonb,
    PRIMARY KEY (accepted, site, press, owner, run_id)
) PARTITION BY RANGE (accepted);
COMMENT ON COLUMN platen.stroke.figures IS 'all figures of the record, in metres, radians, seconds and fractions';
COMMENT ON COLUMN platen.stroke.bends IS 'bends that the stroke made, as the comparison curvature found them; millimetres and degrees';
CREATE INDEX ON platen.stroke USING brin (accepted) WITH (autosummarize = on);
CREATE INDEX ON platen.stroke (site, press, owner, plate);

CREATE TABLE platen.alarm (
    site   text NOT NULL,
    press  text NOT NULL,
    owner  int NOT NULL,
    event  bigint NOT NULL,
    at     timestamptz NOT NULL,
    kind   text NOT NULL,
    code   int,
    text   text NOT NULL,
    run_id bigint,
    PRIMARY KEY (site, press, owner, event)
);
CREATE INDEX ON platen.alarm USING brin (at) WITH (autosummarize = on);

-- Every figure of a stroke as a row.
CREATE VIEW platen.figure AS
    SELECT s.site, s.press, s.owner, s.run_id, s.accepted, f.key AS name, f.value::float8 AS value
    FROM platen.stroke s CROSS JOIN LATERAL jsonb_each_text(s.figures) f;

-- Makes the partition of a month, UTC, where there is none.
CREATE FUNCTION platen.make_partition(at timestamptz) RETURNS void LANGUAGE plpgsql AS $$
DECLARE
    month timestamp := date_trunc('month', at AT TIME ZONE 'UTC');
    partition text := 'stroke_' || to_char(month, 'YYYY_MM');
BEGIN
    IF to_regclass('platen.' || partition) IS NULL THEN
        PERFORM pg_advisory_xact_lock(hashtext('platen.' || partition));
        EXECUTE format('CREATE TABLE IF NOT EXISTS platen.%I PARTITION OF platen.stroke FOR VALUES FROM (%L) TO (%L)',
            partition, month::text || '+00', (month + interval '1 month')::text || '+00');
    END IF;
END $$;

-- Fills the tables from the rows of one insert. The three changes of a stroke make one row, whichever comes first.
CREATE FUNCTION platen.fill() RETURNS trigger LANGUAGE plpgsql SECURITY DEFINER SET search_path = pg_catalog, pg_temp AS $$
BEGIN
    PERFORM platen.make_partition(month) FROM (
        SELECT DISTINCT date_trunc('month', (doc->'stroke'->>'accepted')::timestamptz, 'UTC') FROM came WHERE doc ? 'stroke'
    ) AS months (month);

    INSERT INTO platen.plate AS p (site, press, owner, plate, part_id, part_name, began, ended)
    SELECT DISTINCT ON (site, press, owner, (doc->'plate'->>'number')::bigint)
        site, press, owner, (doc->'plate'->>'number')::bigint, (doc->'plate'->>'part_id')::bigint, doc->'plate'->>'part_name',
        (doc->'plate'->>'began')::timestamptz, CASE WHEN kind = 'plate' THEN at END
    FROM came WHERE doc ? 'plate'
    ORDER BY site, press, owner, (doc->'plate'->>'number')::bigint, (kind = 'plate') DESC, at DESC
    ON CONFLICT (site, press, owner, plate) DO UPDATE SET ended = EXCLUDED.ended WHERE EXCLUDED.ended IS NOT NULL;

    INSERT INTO platen.stroke AS s (site, press, owner, run_id, accepted, scanned, finished, acked, ack, session, stroke, attempt, plate,
        part_id, part_name, recipe, baseline, dry_run, crew, verdict, reason, gap_max_mm, gap_uncertainty_mm, sense, deviation_rms_mm,
        deviation_max_mm, deviation_min_mm, coverage, ram_depth_mm, force_kn, stroke_to_result_s, says, figures, bends)
    SELECT site, press, owner, id, (st->>'accepted')::timestamptz, (r->>'scanned')::timestamptz, (r->>'finished')::timestamptz,
        (a->>'acked')::timestamptz, a->>'how', (st->'key'->>'session')::int, (st->'key'->>'stroke')::int, (st->'key'->>'attempt')::int,
        (pl->>'number')::bigint, (pl->>'part_id')::bigint, pl->>'part_name', (st->>'recipe')::int, (st->>'baseline')::boolean,
        (st->>'dry_run')::boolean, (st->'press_data'->>'crew')::int, r->>'verdict', r->>'reason',
        1000 * (f->>'gap.max')::float8, 1000 * (f->>'gap.uncertainty')::float8, (f->>'sense')::float8::int,
        1000 * (f->>'deviation.rms')::float8, 1000 * (f->>'deviation.max')::float8, 1000 * (f->>'deviation.min')::float8,
        (f->>'coverage')::float8, 1000 * (st->'press_data'->>'ram_depth')::float8, (st->'press_data'->>'force')::float8 / 1000,
        (f->>'stroke_to_result_time')::float8, r->'document'->'says'->>0, f, r->'document'->'bends'
    FROM (
        SELECT site, press, owner, id, (array_agg(doc->'stroke'))[1] AS st, (array_agg(doc->'plate'))[1] AS pl,
            (array_agg(doc->'result') FILTER (WHERE kind = 'finished'))[1] AS r,
            (array_agg(doc->'result'->'figures') FILTER (WHERE kind = 'finished'))[1] AS f,
            (array_agg(doc->'acknowledgement') FILTER (WHERE kind = 'acked'))[1] AS a
        FROM came WHERE doc ? 'stroke' GROUP BY site, press, owner, id
    ) AS change
    ON CONFLICT (accepted, site, press, owner, run_id) DO UPDATE SET
        scanned = coalesce(EXCLUDED.scanned, s.scanned), finished = coalesce(EXCLUDED.finished, s.finished),
        acked = coalesce(EXCLUDED.acked, s.acked), ack = coalesce(EXCLUDED.ack, s.ack), verdict = coalesce(EXCLUDED.verdict, s.verdict),
        reason = coalesce(EXCLUDED.reason, s.reason), gap_max_mm = coalesce(EXCLUDED.gap_max_mm, s.gap_max_mm),
        gap_uncertainty_mm = coalesce(EXCLUDED.gap_uncertainty_mm, s.gap_uncertainty_mm), sense = coalesce(EXCLUDED.sense, s.sense),
        deviation_rms_mm = coalesce(EXCLUDED.deviation_rms_mm, s.deviation_rms_mm),
        deviation_max_mm = coalesce(EXCLUDED.deviation_max_mm, s.deviation_max_mm),
        deviation_min_mm = coalesce(EXCLUDED.deviation_min_mm, s.deviation_min_mm), coverage = coalesce(EXCLUDED.coverage, s.coverage),
        stroke_to_result_s = coalesce(EXCLUDED.stroke_to_result_s, s.stroke_to_result_s), says = coalesce(EXCLUDED.says, s.says),
        figures = coalesce(EXCLUDED.figures, s.figures), bends = coalesce(EXCLUDED.bends, s.bends);

    INSERT INTO platen.alarm (site, press, owner, event, at, kind, code, text, run_id)
    SELECT site, press, owner, id, at, doc->'event'->>'kind', substring(doc->'event'->>'text' FROM '^[0-9]{3}')::int, doc->'event'->>'text',
        (doc->'event'->>'run_id')::bigint
    FROM came WHERE kind = 'event'
    ON CONFLICT DO NOTHING;
    RETURN NULL;
END $$;
CREATE TRIGGER fill AFTER INSERT ON platen.inbox REFERENCING NEW TABLE AS came FOR EACH STATEMENT EXECUTE FUNCTION platen.fill();

-- Rows pass through this table when the tables are filled anew; it is empty otherwise.
CREATE TABLE platen.refill (LIKE platen.inbox);
CREATE TRIGGER fill AFTER INSERT ON platen.refill REFERENCING NEW TABLE AS came FOR EACH STATEMENT EXECUTE FUNCTION platen.fill();
CREATE PROCEDURE platen.rebuild() LANGUAGE plpgsql AS $$
DECLARE
    month timestamptz;
BEGIN
    TRUNCATE platen.stroke, platen.plate, platen.alarm;
    FOR month IN SELECT DISTINCT date_trunc('month', at, 'UTC') FROM platen.inbox ORDER BY 1 LOOP
        INSERT INTO platen.refill SELECT * FROM platen.inbox WHERE at >= month AND at < month + interval '1 month';
        TRUNCATE platen.refill;
    END LOOP;
END $$;

GRANT USAGE ON SCHEMA platen TO platen_writer, platen_reader;
GRANT INSERT ON platen.inbox TO platen_writer;
GRANT SELECT ON ALL TABLES IN SCHEMA platen TO platen_reader;
-- Nobody but the owner calls these.
REVOKE EXECUTE ON ALL ROUTINES IN SCHEMA platen FROM PUBLIC;

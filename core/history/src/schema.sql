-- Times are UTC, RFC 3339 with milliseconds, so that they sort as text and read without a tool.
CREATE TABLE journal (
    press      INTEGER PRIMARY KEY,
    owner      INTEGER NOT NULL CHECK (owner BETWEEN 1 AND 65535),
    result_seq INTEGER NOT NULL DEFAULT 0
) STRICT;

CREATE TABLE plate (
    plate     INTEGER PRIMARY KEY,
    press     INTEGER NOT NULL,
    part_id   INTEGER,
    part_name TEXT,
    began     TEXT NOT NULL,
    ended     TEXT
) STRICT;
CREATE UNIQUE INDEX plate_part ON plate (press, part_id) WHERE part_id IS NOT NULL;

CREATE TABLE stroke (
    run_id      INTEGER PRIMARY KEY,
    press       INTEGER NOT NULL,
    session     INTEGER NOT NULL,
    stroke      INTEGER NOT NULL,
    attempt     INTEGER NOT NULL,
    plate       INTEGER NOT NULL REFERENCES plate,
    recipe      INTEGER,
    baseline    INTEGER NOT NULL,
    dry_run     INTEGER NOT NULL,
    accepted    TEXT NOT NULL,
    scanned     TEXT,
    finished    TEXT,
    acked       TEXT,
    ack         TEXT,
    seq         INTEGER,
    verdict     TEXT,
    reason      TEXT,
    figures     TEXT NOT NULL DEFAULT '{}',
    data        TEXT NOT NULL,
    publication TEXT,
    document    TEXT,
    scan        TEXT,
    scan_sha256 TEXT
) STRICT;
CREATE INDEX stroke_key ON stroke (press, session, stroke, attempt, run_id);
CREATE INDEX stroke_plate ON stroke (plate, run_id);

-- Alarms and jumps of the clock.
CREATE TABLE event (
    event  INTEGER PRIMARY KEY,
    at     TEXT NOT NULL,
    kind   TEXT NOT NULL,
    run_id INTEGER REFERENCES stroke,
    text   TEXT NOT NULL
) STRICT;

-- Format 1.1: what changed, in the order of its commits, for programs that pass the record on. Append-only; written by triggers, so in the
-- transaction of the change itself and by whichever program makes it.
CREATE TABLE change (
    n      INTEGER PRIMARY KEY AUTOINCREMENT,
    run_id INTEGER,
    plate  INTEGER,
    event  INTEGER,
    kind   TEXT NOT NULL,
    at     TEXT NOT NULL
) STRICT;
CREATE INDEX change_run ON change (run_id, kind, n);

CREATE TRIGGER stroke_accepted AFTER INSERT ON stroke BEGIN
    INSERT INTO change (run_id, plate, kind, at) VALUES (NEW.run_id, NEW.plate, 'accepted', NEW.accepted);
END;
CREATE TRIGGER stroke_finished AFTER UPDATE OF finished ON stroke WHEN OLD.finished IS NULL AND NEW.finished IS NOT NULL BEGIN
    INSERT INTO change (run_id, plate, kind, at) VALUES (NEW.run_id, NEW.plate, 'finished', NEW.finished);
END;
CREATE TRIGGER stroke_acked AFTER UPDATE OF acked ON stroke WHEN OLD.acked IS NULL AND NEW.acked IS NOT NULL BEGIN
    INSERT INTO change (run_id, plate, kind, at) VALUES (NEW.run_id, NEW.plate, 'acked', NEW.acked);
END;
CREATE TRIGGER plate_ended AFTER UPDATE OF ended ON plate WHEN OLD.ended IS NULL AND NEW.ended IS NOT NULL BEGIN
    INSERT INTO change (plate, kind, at) VALUES (NEW.plate, 'plate', NEW.ended);
END;
CREATE TRIGGER event_noted AFTER INSERT ON event BEGIN
    INSERT INTO change (run_id, event, kind, at) VALUES (NEW.run_id, NEW.event, 'event', NEW.at);
END;

-- Owner numbers that the record has had, in their order: a restored record gets another one, and a change keeps the number under
-- which it was made, that of a stroke the number under which the stroke was accepted.
CREATE TABLE owner (
    n            INTEGER PRIMARY KEY AUTOINCREMENT,
    owner        INTEGER NOT NULL,
    after_change INTEGER NOT NULL
) STRICT;
CREATE TRIGGER owner_drawn AFTER INSERT ON journal BEGIN
    INSERT INTO owner (owner, after_change) VALUES (NEW.owner, (SELECT ifnull(max(n), 0) FROM change));
END;
CREATE TRIGGER owner_redrawn AFTER UPDATE OF owner ON journal BEGIN
    INSERT INTO owner (owner, after_change) VALUES (NEW.owner, (SELECT ifnull(max(n), 0) FROM change));
END;
INSERT INTO owner (owner, after_change) SELECT owner, 0 FROM journal ORDER BY press;

-- Strokes from before the table, so that none is passed over.
INSERT INTO change (run_id, plate, kind, at)
    SELECT run_id, plate, kind, at FROM (
        SELECT run_id, plate, 'accepted' AS kind, accepted AS at, 0 AS stage FROM stroke
        UNION ALL SELECT run_id, plate, 'finished', finished, 1 FROM stroke WHERE finished IS NOT NULL
        UNION ALL SELECT run_id, plate, 'acked', acked, 2 FROM stroke WHERE acked IS NOT NULL)
    ORDER BY run_id, stage;

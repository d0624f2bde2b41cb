-- Strokes of many presses. A host inserts into platen.inbox and may do nothing else; triggers fill the tables that people query.
-- Applied once, by the owner of the database, by `platen forward schema --apply` or with psql -1.

CREATE SCHEMA platen;
COMMENT ON SCHEMA platen IS 'Strokes of plate bending presses, sent by platen forward';

DO $$
BEGIN
    IF NOT EXISTS (SELECT FROM pg_roles WHERE rolname = 'platen_writer') THEN CREATE ROLE platen_writer NOLOGIN; END IF;
    IF NOT EXISTS (SELECT FROM pg_roles WHERE rolname = 'platen_reader') THEN CREATE ROLE platen_reader NOLOGIN; END IF;
END $$;

CREATE TABLE platen.migration (
    number  int PRIMARY KEY,
    name    text NOT NULL,
    applied timestamptz NOT NULL DEFAULT now()
);

-- What hosts send, as they sent it. The key is that of a change: the same key comes again and again and changes nothing.
CREATE TABLE platen.inbox (
    site     text NOT NULL,
    press    text NOT NULL,
    owner    int NOT NULL,
    kind     text NOT NULL,
    id       bigint NOT NULL,
    at       timestamptz NOT NULL,
    sha256   text NOT NULL,
    doc      jsonb NOT NULL,
    writer   int NOT NULL,
    former   int[] NOT NULL,
    received timestamptz NOT NULL DEFAULT now(),
    PRIMARY KEY (site, press, owner, kind, id)
);
COMMENT ON COLUMN platen.inbox.owner IS 'owner number of the record when the change was made';
COMMENT ON COLUMN platen.inbox.writer IS 'owner number of the record that sent it';
COMMENT ON COLUMN platen.inbox.former IS 'earlier owner numbers of that record, of which it was restored';

-- Which record writes for a press. Another record under the same name is kept apart until `platen.accept` says that it replaces the first.
CREATE TABLE platen.press (
    site     text NOT NULL,
    press    text NOT NULL,
    writer   int NOT NULL,
    since    timestamptz NOT NULL DEFAULT now(),
    rival    int,
    rival_at timestamptz,
    PRIMARY KEY (site, press)
);

-- Messages of a record that has not the name, and messages that differ from one under the same key.
CREATE TABLE platen.aside (
    LIKE platen.inbox,
    why text NOT NULL CHECK (why IN ('apart', 'conflict')),
    PRIMARY KEY (site, press, writer, owner, kind, id, sha256)
);

-- Lets one row into the inbox, or puts it aside with a warning that the host shows.
CREATE FUNCTION platen.check_in() RETURNS trigger LANGUAGE plpgsql SECURITY DEFINER SET search_path = pg_catalog, pg_temp AS $$
DECLARE
    named platen.press;
    known text;
BEGIN
    IF session_user <> NEW.site || '/' || NEW.press AND NOT pg_has_role(session_user, current_user, 'member') THEN
        RAISE EXCEPTION 'user % may not write for %/%', session_user, NEW.site, NEW.press USING ERRCODE = 'insufficient_privilege';
    END IF;
    SELECT * INTO named FROM platen.press p WHERE p.site = NEW.site AND p.press = NEW.press;
    IF NOT FOUND THEN
        INSERT INTO platen.press (site, press, writer) VALUES (NEW.site, NEW.press, NEW.writer) ON CONFLICT DO NOTHING;
        SELECT * INTO named FROM platen.press p WHERE p.site = NEW.site AND p.press = NEW.press;
    END IF;
    IF named.writer <> NEW.writer AND named.writer = ANY (NEW.former) THEN
        -- Restored from a backup of the record that wrote until now.
        UPDATE platen.press p SET writer = NEW.writer, since = now() WHERE p.site = NEW.site AND p.press = NEW.press;
    ELSIF named.writer <> NEW.writer THEN
        INSERT INTO platen.aside SELECT NEW.*, 'apart' ON CONFLICT DO NOTHING;
        UPDATE platen.press p SET rival = NEW.writer, rival_at = now() WHERE p.site = NEW.site AND p.press = NEW.press;
        RAISE WARNING 'platen apart: %/% is the name of another record (owner %) since %; its strokes are kept apart: give each press a name of its own, or, where this host replaces the other, let the owner of the database run SELECT platen.accept(''%'', ''%'', %)',
            NEW.site, NEW.press, named.writer, named.since::date, NEW.site, NEW.press, NEW.writer;
        RETURN NULL;
    ELSIF named.rival_at > now() - interval '10 minutes' THEN
        RAISE WARNING 'platen apart: another record (owner %) sends as %/% too, and is kept apart: give each press a name of its own', named.rival, NEW.site, NEW.press;
    END IF;
    SELECT i.sha256 INTO known FROM platen.inbox i
        WHERE i.site = NEW.site AND i.press = NEW.press AND i.owner = NEW.owner AND i.kind = NEW.kind AND i.id = NEW.id;
    IF NOT FOUND THEN
        RETURN NEW;
    END IF;
    IF known <> NEW.sha256 THEN
        INSERT INTO platen.aside SELECT NEW.*, 'conflict' ON CONFLICT DO NOTHING;
        RAISE WARNING 'platen conflict: % % %', NEW.owner, NEW.kind, NEW.id;
    END IF;
    RETURN NULL;
END $$;
CREATE TRIGGER check_in BEFORE INSERT ON platen.inbox FOR EACH ROW EXECUTE FUNCTION platen.check_in();

ALTER TABLE platen.inbox ENABLE ROW LEVEL SECURITY;
CREATE POLICY writer ON platen.inbox FOR INSERT TO platen_writer WITH CHECK (session_user = site || '/' || press);
CREATE POLICY reader ON platen.inbox FOR SELECT TO platen_reader USING (true);

-- A host of this record replaces the one that wrote for a press; what was kept apart comes in.
CREATE FUNCTION platen.accept(of_site text, of_press text, new_writer int) RETURNS bigint LANGUAGE plpgsql AS $$
DECLARE
    came_in bigint;
BEGIN
    UPDATE platen.press SET writer = new_writer, since = now(), rival = NULL, rival_at = NULL WHERE site = of_site AND press = of_press;
    INSERT INTO platen.inbox (site, press, owner, kind, id, at, sha256, doc, writer, former)
        SELECT site, press, owner, kind, id, at, sha256, doc, writer, former FROM platen.aside
        WHERE site = of_site AND press = of_press AND writer = new_writer AND why = 'apart' ORDER BY received, id;
    GET DIAGNOSTICS came_in = ROW_COUNT;
    DELETE FROM platen.aside WHERE site = of_site AND press = of_press AND writer = new_writer AND why = 'apart';
    RETURN came_in;
END $$;

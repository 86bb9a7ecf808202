// A store of version 1 as SQL text: its tables as the first program made them, and three rows.
// clang-format off
R"sql(
PRAGMA application_id=1936291952;
PRAGMA user_version=1;
CREATE TABLE head (one INTEGER PRIMARY KEY CHECK (one = 1), rows INTEGER NOT NULL, hash BLOB NOT
NULL) STRICT;
CREATE TABLE attachments (sha256 TEXT PRIMARY KEY, bytes BLOB NOT NULL) STRICT;
CREATE TRIGGER attachments_no_UPDATE BEFORE UPDATE ON attachments BEGIN SELECT RAISE(ABORT,
'history never changes: write a correction instead'); END;
CREATE TRIGGER attachments_no_DELETE BEFORE DELETE ON attachments BEGIN SELECT RAISE(ABORT,
'history never changes: write a correction instead'); END;
CREATE TABLE units (seq INTEGER PRIMARY KEY, serial TEXT NOT NULL UNIQUE, model TEXT NOT NULL,
first_seen_ns INTEGER NOT NULL, hash BLOB NOT NULL) STRICT;
CREATE TRIGGER units_no_UPDATE BEFORE UPDATE ON units BEGIN SELECT RAISE(ABORT, 'history never
changes: write a correction instead'); END;
CREATE TRIGGER units_no_DELETE BEFORE DELETE ON units BEGIN SELECT RAISE(ABORT, 'history never
changes: write a correction instead'); END;
CREATE TABLE runs (seq INTEGER PRIMARY KEY, id TEXT NOT NULL UNIQUE, serial TEXT NOT NULL
REFERENCES units(serial), kind TEXT NOT NULL, filter TEXT NOT NULL, started_ns INTEGER NOT NULL,
ended_ns INTEGER NOT NULL, operator TEXT NOT NULL, station TEXT NOT NULL, jig TEXT NOT NULL,
verdict TEXT NOT NULL, software TEXT NOT NULL, retest_of TEXT REFERENCES runs(id), document TEXT
NOT NULL, hash BLOB NOT NULL) STRICT;
CREATE INDEX runs_by_1 ON runs (serial);
CREATE INDEX runs_by_2 ON runs (jig);
CREATE TRIGGER runs_no_UPDATE BEFORE UPDATE ON runs BEGIN SELECT RAISE(ABORT, 'history never
changes: write a correction instead'); END;
CREATE TRIGGER runs_no_DELETE BEFORE DELETE ON runs BEGIN SELECT RAISE(ABORT, 'history never
changes: write a correction instead'); END;
CREATE TABLE captures (seq INTEGER PRIMARY KEY, id TEXT NOT NULL UNIQUE, run_id TEXT NOT NULL
REFERENCES runs(id), name TEXT NOT NULL, sha256 TEXT NOT NULL REFERENCES attachments(sha256), hash
BLOB NOT NULL) STRICT;
CREATE INDEX captures_by_1 ON captures (run_id);
CREATE TRIGGER captures_no_UPDATE BEFORE UPDATE ON captures BEGIN SELECT RAISE(ABORT, 'history
never changes: write a correction instead'); END;
CREATE TRIGGER captures_no_DELETE BEFORE DELETE ON captures BEGIN SELECT RAISE(ABORT, 'history
never changes: write a correction instead'); END;
CREATE TABLE constants (seq INTEGER PRIMARY KEY, id TEXT NOT NULL UNIQUE, serial TEXT NOT NULL
REFERENCES units(serial), filter TEXT NOT NULL, made_at_ns INTEGER NOT NULL, method TEXT NOT NULL,
run_id TEXT REFERENCES runs(id), document TEXT NOT NULL, hash BLOB NOT NULL) STRICT;
CREATE INDEX constants_by_1 ON constants (serial, filter, made_at_ns);
CREATE TRIGGER constants_no_UPDATE BEFORE UPDATE ON constants BEGIN SELECT RAISE(ABORT, 'history
never changes: write a correction instead'); END;
CREATE TRIGGER constants_no_DELETE BEFORE DELETE ON constants BEGIN SELECT RAISE(ABORT, 'history
never changes: write a correction instead'); END;
CREATE TABLE unit_writes (seq INTEGER PRIMARY KEY, id TEXT NOT NULL UNIQUE, run_id TEXT NOT NULL
REFERENCES runs(id), serial TEXT NOT NULL REFERENCES units(serial), written_ns INTEGER NOT NULL,
as_found TEXT NOT NULL, as_left TEXT NOT NULL, read_back TEXT NOT NULL, hash BLOB NOT NULL) STRICT;
CREATE INDEX unit_writes_by_1 ON unit_writes (serial);
CREATE TRIGGER unit_writes_no_UPDATE BEFORE UPDATE ON unit_writes BEGIN SELECT RAISE(ABORT,
'history never changes: write a correction instead'); END;
CREATE TRIGGER unit_writes_no_DELETE BEFORE DELETE ON unit_writes BEGIN SELECT RAISE(ABORT,
'history never changes: write a correction instead'); END;
CREATE TABLE repairs (seq INTEGER PRIMARY KEY, id TEXT NOT NULL UNIQUE, serial TEXT NOT NULL,
made_at_ns INTEGER NOT NULL, input TEXT NOT NULL, input_sha256 TEXT NOT NULL, output_sha256 TEXT
NOT NULL, method TEXT NOT NULL, constants_id TEXT REFERENCES constants(id), document TEXT NOT
NULL, hash BLOB NOT NULL) STRICT;
CREATE INDEX repairs_by_1 ON repairs (constants_id);
CREATE INDEX repairs_by_2 ON repairs (input_sha256);
CREATE INDEX repairs_by_3 ON repairs (output_sha256);
CREATE INDEX repairs_by_4 ON repairs (serial);
CREATE TRIGGER repairs_no_UPDATE BEFORE UPDATE ON repairs BEGIN SELECT RAISE(ABORT, 'history never
changes: write a correction instead'); END;
CREATE TRIGGER repairs_no_DELETE BEFORE DELETE ON repairs BEGIN SELECT RAISE(ABORT, 'history never
changes: write a correction instead'); END;
CREATE TABLE corrections (seq INTEGER PRIMARY KEY, id TEXT NOT NULL UNIQUE, made_at_ns INTEGER NOT
NULL, about_table TEXT NOT NULL, about_id TEXT NOT NULL, action TEXT NOT NULL, operator TEXT NOT
NULL, reason TEXT NOT NULL, hash BLOB NOT NULL) STRICT;
CREATE INDEX corrections_by_1 ON corrections (about_table, about_id);
CREATE TRIGGER corrections_no_UPDATE BEFORE UPDATE ON corrections BEGIN SELECT RAISE(ABORT,
'history never changes: write a correction instead'); END;
CREATE TRIGGER corrections_no_DELETE BEFORE DELETE ON corrections BEGIN SELECT RAISE(ABORT,
'history never changes: write a correction instead'); END;
INSERT INTO units VALUES (1, 'MOS2A1', 'wGT3X-BT', 1400000000000000000,
x'93fbed209f8f921765513484f7dcb8f00e4056e76bbdb8c2abd72fc71864163e');
INSERT INTO runs VALUES (2, '11111111111111111111111111111111', 'MOS2A1', 'jig', 'legacy',
1400000000000000000, 1400000060000000000, 'Ada', 'S1', 'J1', 'pass', 'sixpoint 0.1.0', NULL, '{}',
x'a41883348e48b6eaf90197202695e599b1138f7c1f822c51efaa7e79813497b4');
INSERT INTO constants VALUES (3, '22222222222222222222222222222222', 'MOS2A1', 'legacy',
1400000060000000000, 'jig', '11111111111111111111111111111111', '{"n":1}',
x'74f4943fa1dd97ddebe9c81a3d40776ef9b0ee4af156aa10d9e7766429e3d57d');
INSERT INTO head VALUES (1, 3,
x'74f4943fa1dd97ddebe9c81a3d40776ef9b0ee4af156aa10d9e7766429e3d57d');
)sql"
    // clang-format on

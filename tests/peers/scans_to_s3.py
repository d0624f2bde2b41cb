#!/usr/bin/env python3
"""The line of config/scans/platen-scans.service, as it stands there, with Debian's rclone against the S3 server of moto: every scan arrives once under its SHA-256,
nothing is put again, an object cut short and a scan that changed are told and left alone, a server that is away loses nothing, and a wrong key is one sentence.

    apt-get install rclone; pip install 'moto[server]==5.2.1'
    python3 tests/peers/scans_to_s3.py

The scans are random bytes in a folder as [scan_store] fills it. Each check prints a line; the first that fails ends the program with exit code 1.
"""
import hashlib, json, logging, os, shlex, socket, subprocess, tempfile
from pathlib import Path

import boto3
from botocore.config import Config

# Set up by anybody, in four requests; from then on each one is authorised. Read at the import.
os.environ["INITIAL_NO_AUTH_ACTION_COUNT"] = "4"
from moto.server import ThreadedMotoServer

logging.getLogger("werkzeug").setLevel(logging.ERROR)

UNIT = Path(__file__).resolve().parents[2] / "config/scans/platen-scans.service"
BUCKET = "platen-scans"
FOLDER = "/var/lib/platen/store"
# Permissions that the user needs according to the unit's comment.
RIGHTS = {"Version": "2012-10-17", "Statement": [{"Effect": "Allow", "Action": ["s3:ListBucket", "s3:GetObject", "s3:PutObject"],
                                                  "Resource": [f"arn:aws:s3:::{BUCKET}", f"arn:aws:s3:::{BUCKET}/*"]}]}


class Store:
    """moto's server, in which the user of a plant has RIGHTS."""

    def __init__(self):
        self.server = ThreadedMotoServer("127.0.0.1", 0, verbose=False)
        self.server.start()
        self.url = "http://%s:%d" % self.server.get_host_and_port()
        anybody = dict(endpoint_url=self.url, region_name="us-east-1", aws_access_key_id="a", aws_secret_access_key="b")
        boto3.client("s3", **anybody).create_bucket(Bucket=BUCKET)
        iam = boto3.client("iam", **anybody)
        iam.create_user(UserName="plant")
        iam.put_user_policy(UserName="plant", PolicyName="scans", PolicyDocument=json.dumps(RIGHTS))
        made = iam.create_access_key(UserName="plant")["AccessKey"]
        self.key, self.secret = made["AccessKeyId"], made["SecretAccessKey"]
        self.client = boto3.client("s3", endpoint_url=self.url, region_name="us-east-1", aws_access_key_id=self.key, aws_secret_access_key=self.secret,
                                   config=Config(retries={"max_attempts": 1}))

    def objects(self):
        """Name, size and time of what is there."""
        found = self.client.list_objects_v2(Bucket=BUCKET).get("Contents", [])
        return {it["Key"]: (it["Size"], it["LastModified"]) for it in found}

    def stop(self):
        self.server.stop()


def configure(place, url, key, secret):
    (place / "scans.conf").write_text(f"[store]\ntype = s3\nprovider = Other\nendpoint = {url}\naccess_key_id = {key}\nsecret_access_key = {secret}\n")


def copy(place):
    """Runs the unit's line on this folder; returns its exit code and what it says."""
    line = next(it for it in UNIT.read_text().splitlines() if it.startswith("ExecStart=")).removeprefix("ExecStart=")
    words = shlex.split(line.replace("${CREDENTIALS_DIRECTORY}", str(place)))
    assert words.count(FOLDER) == 1, line
    words[words.index(FOLDER)] = str(place / "store")
    # A unit has next to no environment.
    done = subprocess.run(words, capture_output=True, text=True, timeout=120, env={"PATH": "/usr/bin:/bin", "HOME": str(place)})
    return done.returncode, (done.stdout + done.stderr).strip().splitlines()


def keep(place, size=300_000):
    """Adds a scan to the folder of the store; returns its name there."""
    scan = os.urandom(size)
    name = hashlib.sha256(scan).hexdigest()
    file = place / "store/scans" / name[:2] / f"{name}.e57"
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_bytes(scan)
    return f"scans/{name[:2]}/{name}.e57"


def main():
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        store = Store()
        try:
            configure(place, store.url, store.key, store.secret)
            names = {keep(place) for _ in range(20)} | {keep(place, 25_000_000)}
            (place / "store/scans/ab").mkdir(exist_ok=True)
            (place / "store/scans/ab/half.e57.part").write_bytes(b"being written")
            assert copy(place) == (0, []), copy(place)
            first = store.objects()
            assert set(first) == names, set(first) ^ names
            for name in names:
                body = store.client.get_object(Bucket=BUCKET, Key=name)["Body"].read()
                assert hashlib.sha256(body).hexdigest() == Path(name).stem, name
            print(f"{len(names)} scans arrived, each under its SHA-256; a file that is being written did not")

            later = keep(place)
            assert copy(place) == (0, [])
            second = store.objects()
            assert {name: second[name] for name in first} == first and set(second) == names | {later}
            print("a scan more: it alone was put")

            cut, changed = sorted(names)[:2]
            store.client.put_object(Bucket=BUCKET, Key=cut, Body=b"short")
            with open(place / "store" / changed, "ab") as file:
                file.write(b"more")
            before = store.objects()
            code, lines = copy(place)
            assert code != 0 and store.objects() == before, (code, lines)
            for name in (cut, changed):
                assert any(Path(name).name in line and "immutable" in line for line in lines), lines
            print(f"an object that was cut short, a scan that changed: left alone; {lines[0]}")
            store.client.put_object(Bucket=BUCKET, Key=cut, Body=(place / "store" / cut).read_bytes())
            (place / "store" / changed).write_bytes((place / "store" / changed).read_bytes()[:-4])

            waiting = {keep(place) for _ in range(3)}
            configure(place, store.url, store.key, "x" * 40)
            code, lines = copy(place)
            says = [line for line in lines if "Failed to copy: SignatureDoesNotMatch" in line]
            assert code != 0 and len(says) == 1, (code, lines)
            print(f"wrong key: {says[0]}")
            with socket.socket() as unserved:
                unserved.bind(("127.0.0.1", 0))
                configure(place, "http://%s:%d" % unserved.getsockname(), store.key, store.secret)
                code, lines = copy(place)
            says = [line for line in lines if "connection refused" in line]
            assert code != 0 and says, (code, lines)
            print(f"server away: {says[-1]}")
            assert all((place / "store" / name).is_file() for name in names | {later} | waiting)
            configure(place, store.url, store.key, store.secret)
            assert copy(place) == (0, [])
            assert set(store.objects()) == names | {later} | waiting
            print("there again: everything arrived")
        finally:
            store.stop()


if __name__ == "__main__":
    main()

#!/usr/bin/env python3
"""Diagnoses every case in a folder on a Dask cluster: a case a task, with retries, and one table of all.

    python3 diagnose_fleet.py CASES --out DIR                          workers on this machine, one a core
    python3 diagnose_fleet.py CASES --out DIR --workers 2
    python3 diagnose_fleet.py CASES --out DIR --scheduler tcp://HOST:8786

Needs PyPI `dask[distributed]` and the executable `kerbside` on every worker; CASES and DIR are folders that all of them
see under the same path. DIR/NAME holds what `kerbside diagnose` wrote of the case NAME; DIR/fleet.csv is the table.
What the same version has diagnosed before is kept.

Exit status: 0, or 1 if a case failed, or 2 on a wrong command line, or 65 if there is no case.
"""
import argparse
import csv
import json
import os
import pathlib
import socket
import subprocess
import sys
import time

from dask.distributed import Client, LocalCluster, as_completed

COLUMNS = "case error verdict where effects probability before_m after_m removed kept worker seconds".split()
# The input is at fault (65), or the command line (2): another attempt ends the same way.
FINAL = {2, 65}


class Unfinished(RuntimeError):
    """An attempt that may go well elsewhere: the process was killed, the disk was full."""


def diagnose(kerbside, case, out, timeout):
    """Diagnoses the folder `case` into `out` in a process of its own; a row of the table as a dictionary.

    Raises Unfinished where another attempt may help: Dask makes it, on any worker.
    """
    begin = time.monotonic()
    row = {"case": case.name, "worker": socket.gethostname()}
    version = subprocess.run([kerbside, "--version"], capture_output=True, text=True, check=True).stdout.split()[-1]
    document = diagnosis(out, version)
    row["kept"] = document is not None
    if document is None:
        # Each task has a core; a process that takes all of them would take the others'.
        environment = {**os.environ, "RAYON_NUM_THREADS": "1"}
        command = [kerbside, "diagnose", str(case), "--out", str(out), "--json"]
        try:
            ended = subprocess.run(command, capture_output=True, text=True, timeout=timeout, env=environment)
        except subprocess.TimeoutExpired as error:
            raise Unfinished(f"{case.name}: no answer in {timeout:.0f} s") from error
        if ended.returncode in FINAL:
            return {**row, "error": failure(ended), "seconds": round(time.monotonic() - begin, 2)}
        if ended.returncode != 0:
            raise Unfinished(f"{case.name}: exit code {ended.returncode}: {failure(ended)}")
        document = json.loads(ended.stdout)
    return {**row, **found(document), "seconds": round(time.monotonic() - begin, 2)}


def diagnosis(out, version):
    """The diagnosis that `out` holds, if this version made it; None otherwise."""
    try:
        document = json.loads((out / "diagnosis.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return document if document.get("version") == version else None


def failure(ended):
    """Why a process failed, in one line."""
    try:
        told = json.loads(ended.stdout)
        return "; ".join(told["problems"]) or told["error"]
    except (ValueError, KeyError, TypeError):
        return " ".join(ended.stderr.split()) or "it said nothing"


def found(document):
    """The columns that come from diagnosis.json."""
    gap = document["gap"] or {}
    links = document["where"] or []
    alternatives = document["alternatives"]
    return {
        "verdict": document["verdict"],
        "where": links if isinstance(links, str) else "+".join(links),
        "effects": "+".join(effect["id"] for effect in document["effects"]),
        "probability": alternatives[0]["probability"] if alternatives else None,
        "before_m": gap.get("before"),
        "after_m": gap.get("after"),
        "removed": gap.get("explainable_removed"),
    }


def cases_in(folder):
    """The case folders in `folder`, in the order of their names: those with vehicle.toml or runs."""
    is_case = lambda path: (path / "vehicle.toml").is_file() or (path / "runs").is_dir()
    return sorted(path for path in folder.iterdir() if path.is_dir() and is_case(path))


def run(client, cases, options):
    """A row per case, in the order of the cases; each is printed when it comes."""
    rows, names = {}, {}
    for case in cases:
        task = client.submit(
            diagnose, options.kerbside, case, options.out / case.name, options.timeout,
            key=f"{case.name}-{time.time_ns()}", retries=options.retries, pure=False,
        )
        names[task] = case.name
    for count, task in enumerate(as_completed(names), start=1):
        name = names[task]
        if task.status == "finished":
            rows[name] = task.result()
        else:
            rows[name] = {"case": name, "error": " ".join(str(task.exception()).split())}
        row = rows[name]
        said = row.get("error") or f"{row['verdict']:10} {row['effects']}"
        print(f"{count:>5}/{len(cases)} {name:20} {said}".rstrip(), file=sys.stderr)
    return [rows[case.name] for case in cases]


def write(path, rows):
    """The table, whole or not at all."""
    part = path.with_suffix(".part")
    with open(part, "w", newline="", encoding="utf-8") as file:
        table = csv.DictWriter(file, COLUMNS)
        table.writeheader()
        table.writerows(rows)
    part.replace(path)


def options():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("cases", type=pathlib.Path, help="folder of case folders")
    parser.add_argument("--out", type=pathlib.Path, required=True, help="folder for the diagnoses and fleet.csv")
    where = parser.add_mutually_exclusive_group()
    where.add_argument("--scheduler", help="address of a running Dask scheduler")
    where.add_argument("--workers", type=int, default=os.cpu_count(), help="workers on this machine (default: a core each)")
    parser.add_argument("--kerbside", default="kerbside", help="the executable, as workers find it")
    parser.add_argument("--retries", type=int, default=2, help="further attempts at a case whose process was lost")
    parser.add_argument("--timeout", type=float, default=3600.0, help="seconds that a case may take")
    return parser.parse_args()


def main():
    chosen = options()
    chosen.cases, chosen.out = chosen.cases.resolve(), chosen.out.resolve()
    cases = cases_in(chosen.cases) if chosen.cases.is_dir() else []
    if not cases:
        print(f"{chosen.cases}: there is no case in it: a folder with vehicle.toml and runs/NAME", file=sys.stderr)
        return 65
    chosen.out.mkdir(parents=True, exist_ok=True)
    if chosen.scheduler:
        with Client(chosen.scheduler) as client:
            rows = run(client, cases, chosen)
    else:
        with LocalCluster(n_workers=chosen.workers, threads_per_worker=1, dashboard_address=None) as cluster:
            with Client(cluster) as client:
                rows = run(client, cases, chosen)
    table = chosen.out / "fleet.csv"
    write(table, rows)
    failed = sum(bool(row.get("error")) for row in rows)
    print(f"{len(rows)} cases, {failed} failed")
    print(f"table {table}")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())

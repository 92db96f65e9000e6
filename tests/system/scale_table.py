#!/usr/bin/env python3
"""Measures what trainees and observers cost a server: sessions in real time whose trainees each press a hand of their own on the box of peg_and_box.

    python3 tests/system/scale_table.py [--trainees 1,2,4,8] [--observers 0,20] [--seconds 12]

All programs run on this machine, in a network namespace of their own so that the bytes on its loopback are theirs; a recorder is one of them. Of a row:
processor time of the server and of all stations, the computing time of ticks, the age of forces at the stations (the 99th percentile of each station, the
median of it over time, the worst station), the bytes on the bus, and the ticks that began late. Nothing is asserted: times depend on the machine.
"""
import argparse
import os
import re
import statistics
import struct
import subprocess
import sys
import time

from safety_test import messages
from stage import COARSE, SOURCE, Process, Stage

PLACES = [(x, y) for y in (-0.07, 0.07) for x in (-0.075, -0.025, 0.025, 0.075)]  # [m] on the box's top


def p99(values):
    return sorted(values)[int(0.99 * (len(values) - 1))]


class OneMachine(Stage):
    """A session in a network namespace with a loopback alone."""

    def __enter__(self):
        self.network = f"tenon-{os.getpid()}"
        subprocess.run(["ip", "netns", "add", self.network], check=True)
        subprocess.run(["ip", "-n", self.network, "link", "set", "lo", "up"], check=True)
        return super().__enter__()

    def __exit__(self, *what):
        super().__exit__(*what)
        subprocess.run(["ip", "netns", "del", self.network], check=True)

    def start(self, name, *arguments):
        more = ["--session", self.session, "--domain", self.domain, *(COARSE if name == "serve" else [])]
        process = Process(name, [*arguments, *more], self.out, inside=["ip", "netns", "exec", self.network])
        self.processes.append(process)
        return process

    def bytes(self):
        text = subprocess.run(["ip", "netns", "exec", self.network, "cat", "/proc/net/dev"], capture_output=True, text=True, check=True).stdout
        return int(re.search(r"lo:\s*(\d+)", text)[1])


def scenario(stage, trainees):
    """peg_and_box with a hand and a pointer for each trainee, and a first step that does not end; and the names of the hands."""
    text = (SOURCE / "scenarios" / "peg_and_box" / "scenario.yaml").read_text(encoding="utf-8")
    objects, hands, rest = re.split(r"(?m)^(?=hands:|pairs:)", text)
    (pointer,) = re.findall(r"(?ms)^  - name: pointer\n.*?\n\n", objects)
    (assistant,) = re.findall(r"(?ms)^  - name: assistant\n.*?\n\n", objects)
    objects = objects.replace(pointer, "").replace(assistant, "")
    names = ["right", *(f"right{i}" for i in range(1, trainees))]
    hands = "hands:\n"
    for name, (x, y) in zip(names, PLACES):
        objects += pointer.replace("name: pointer", f"name: pointer_{name}").replace("[0.0, -0.20, 0.15]", f"[{x}, {y}, 0.05]")
        hands += f"  - {{name: {name}, object: pointer_{name}}}\n"
    file = stage.out / "scenario.yaml"
    file.write_text("parts: peg_and_box\n" + objects + hands + re.sub(r"timeout: \d+ s", "timeout: 7200 s", rest), encoding="utf-8")
    return file, names


def path(stage, number):
    """A hand goes down to the box and slides on it to and fro, 2 mm below its face."""
    x, y = PLACES[number]
    rows = ["t,x,y,z,qw,qx,qy,qz", f"0,{x},{y},0.05,1,0,0,0", f"2,{x},{y},-0.002,1,0,0,0"]
    rows += [f"{3 + i},{x},{y + (0.01 if i % 2 else -0.01)},-0.002,1,0,0,0" for i in range(120)]
    file = stage.out / f"path{number}.csv"
    file.write_text("\n".join(rows) + "\n", encoding="utf-8")
    return file


def measure(trainees, observers, seconds):
    with OneMachine(lockstep=False) as stage:
        file, hands = scenario(stage, trainees)
        server = stage.serve(file, "--wait-for", ",".join(hands), "--journal", stage.out / "journal.mcap")
        recorder = stage.start("record", "-o", stage.out / "session.mcap")
        recorder.wait_for("recording", 60)
        stations = [stage.start("trainee", "--device", "sigma7-sim", "--tracker", "none", "--hands", hand, "--person", path(stage, i), "--arm",
                                "--name", f"trainee {i}") for i, hand in enumerate(hands)]
        server.wait_for("run: running", 120)
        watching = [stage.start("observer") for _ in range(observers)]
        for observer in watching:
            observer.wait_for(".", 60)
        time.sleep(4)
        before = [server.processor_seconds(), sum(station.processor_seconds() for station in stations), stage.bytes(), time.monotonic()]
        time.sleep(seconds)
        after = [server.processor_seconds(), sum(station.processor_seconds() for station in stations), stage.bytes(), time.monotonic()]
        load = os.getloadavg()[0]
        stage.start("command", "stop").wait(60)
        for process in (server, recorder):
            process.wait(60)
        of_server, of_stations, carried, took = (now - then for now, then in zip(after, before))
        ticks, ages = recorded(stage.out / "session.mcap", seconds)
        late = re.search(r"late ticks: (\d+)", server.text())
        row = [trainees, observers, f"{100 * of_server / took:.0f} %", f"{100 * of_stations / took / trainees:.0f} %", f"{1e3 * statistics.median(ticks):.2f}",
               f"{1e3 * p99(ticks):.2f}", f"{1e3 * ages:.1f}", f"{8e-6 * carried / took:.1f}", late.group(1) if late else "?", f"{load:.1f}"]
        print("| " + " | ".join(map(str, row)) + " |", flush=True)


def recorded(file, seconds):
    """Of the last seconds: the longest of ten ticks each [s], and the age of forces at the station where it is worst [s]."""
    ticks, ages = [], {}
    for topic, message in messages(file):
        if topic == "TickStats_100":  # server_epoch, tick, load_percent, compute_seconds, compute_seconds_max
            ticks.append(struct.unpack_from("<d", message, 32)[0])
        if topic == "Telemetry":  # client_id, input_to_force_p50, input_to_force_p99
            ages.setdefault(struct.unpack_from("<I", message)[0], []).append(struct.unpack_from("<d", message, 16)[0])
    return ticks[-int(100 * seconds):], max((statistics.median(found[-int(seconds):]) for found in ages.values()), default=float("nan"))


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--trainees", default="1,2,4,8")
    parser.add_argument("--observers", default="0,20")
    parser.add_argument("--seconds", type=int, default=12, help="that are measured")
    args = parser.parse_args()
    print("| trainees | observers | server, of a core | a station | longest of ten ticks, median [ms] | 99 % [ms] | age of forces, 99 % [ms] | bus [Mbit/s] | late ticks | load |")
    print("|---" * 10 + "|")
    for observers in map(int, args.observers.split(",")):
        for trainees in map(int, args.trainees.split(",")):
            measure(trainees, observers, args.seconds)
    return 0


if __name__ == "__main__":
    sys.exit(main())

#!/usr/bin/env python3
"""Draws the angle of the knee that the app `gait` has computed.

Usage: gait.py LOG OUT. LOG has the machine lines of a run (./scripts/run --app gait --json), OUT
ends in .svg or .png. Needs matplotlib. The same lines give the same picture.
"""

import json
import sys

import matplotlib

matplotlib.use("agg")
import matplotlib.pyplot as plt

SAMPLES_A_SECOND = 120

plt.rcParams.update(
    {
        "svg.hashsalt": "gait",
        "axes.spines.top": False,
        "axes.spines.right": False,
        "axes.grid": True,
        "grid.color": "#e3e7ec",
    }
)


def main():
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    log, out = sys.argv[1:]
    degrees = []
    with open(log) as lines:
        for line in lines:
            value = json.loads(line) if line.startswith("{") else {}
            if value.get("kind") == "gait_knee":
                degrees += [angle / 1e6 for angle in value["angles_udeg"]]
    seconds = [sample / SAMPLES_A_SECOND for sample in range(len(degrees))]
    plt.figure(figsize=(9, 3), layout="constrained")
    plt.plot(seconds, degrees, color="#2166ac", linewidth=1.2)
    plt.xlabel("time [s]")
    plt.ylabel("angle of the knee [degrees]")
    plt.xlim(0, seconds[-1] if seconds else 1)
    plt.savefig(out, metadata={"Date": None} if out.endswith(".svg") else None)


if __name__ == "__main__":
    main()

#!/usr/bin/env python3
"""Draws the picture of `./scripts/bench bounds`, from the table it wrote.

Usage: bounds.py DIR. Reads DIR/bounds.csv, writes DIR/plots/bounds.svg. Needs
matplotlib. The same table gives the same bytes.
"""

import csv
import pathlib
import sys

import matplotlib

matplotlib.use("svg")
import matplotlib.pyplot as plt

# One colour a policy; what was before is lighter and dashed.
CURVES = [
    ("gfp_now", "G-FP, multi-path", "#1b7837", "-"),
    ("gfp_before", "G-FP, before", "#7fbf7b", "--"),
    ("gedf_now", "G-EDF, multi-path", "#2166ac", "-"),
    ("gedf_before", "G-EDF, before", "#67a9cf", "--"),
]

plt.rcParams.update(
    {
        "svg.hashsalt": "bounds",
        "font.size": 10,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "axes.grid": True,
        "axes.axisbelow": True,
        "grid.color": "#e3e7ec",
        "grid.linewidth": 0.7,
        "legend.frameon": False,
    }
)


def main():
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    out = pathlib.Path(sys.argv[1])
    with (out / "bounds.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    cores = list(dict.fromkeys(int(row["cores"]) for row in rows))
    figure, panels = plt.subplots(
        1, len(cores), figsize=(3.4 * len(cores), 3.4), sharey=True, squeeze=False,
        layout="constrained",
    )
    for panel, count in zip(panels[0], cores):
        own = [row for row in rows if int(row["cores"]) == count]
        loads = [float(row["load"]) for row in own]
        for key, label, colour, style in CURVES:
            shares = [int(row[key]) / int(row["sets"]) for row in own]
            panel.plot(loads, shares, style, color=colour, label=label, linewidth=1.8)
        panel.set_title(f"{count} cores")
        panel.set_xlabel("load over all cores")
        panel.set_ylim(0, 1.02)
    panels[0][0].set_ylabel("sets proven")
    panels[0][0].legend()
    plots = out / "plots"
    plots.mkdir(exist_ok=True)
    plt.savefig(plots / "bounds.svg", metadata={"Date": None})


if __name__ == "__main__":
    main()

#!/usr/bin/env python3
"""Draws the pictures of `./scripts/bench join-latency`, from the files it wrote.

Usage: join_latency.py DIR. Reads DIR/summary.json, DIR/samples.csv and
DIR/conditions/*.csv, writes DIR/plots/*.svg. Needs matplotlib. The same files
give the same bytes.
"""

import collections
import csv
import json
import pathlib
import sys

import matplotlib

matplotlib.use("svg")
import matplotlib.pyplot as plt

NS_PER_MS = 1e6
PERIOD_NS = 25_000_000
# One colour a policy: green the DAG, blue equal stamps, warm colours close ones.
FASS, EXACT = "#1b7837", "#2166ac"
APPROXIMATE = ["#b2182b", "#e08214", "#c9a400", "#8c510a", "#7b3294"]
TITLES = {"fass": "FasS (DAG)", "exact": "ExactTime"}

plt.rcParams.update(
    {
        "svg.hashsalt": "join-latency",
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
    summary = json.loads((out / "summary.json").read_text())
    policies = list(dict.fromkeys(result["policy"] for result in summary["results"]))
    subtasks = sorted({result["subtasks"] for result in summary["results"]})
    colours = colours_of(policies)
    jobs = {(r["policy"], r["subtasks"]): r["jobs"] for r in summary["results"]}
    samples = read_samples(out / "samples.csv")
    plots = out / "plots"
    plots.mkdir(exist_ok=True)

    for metric, label in [
        ("join_latency", "join latency, literal"),
        ("cover_delay", "cover delay"),
        ("response", "end-to-end response"),
    ]:
        box_plots(samples, metric, label, policies, subtasks, colours, jobs)
        save(plots / f"{metric}.svg")
    distribution(samples, policies, max(subtasks), colours, jobs)
    save(plots / "distribution.svg")
    gantt(out, summary, policies, middle(subtasks), colours)
    save(plots / "gantt.svg")


def colours_of(policies):
    rest = iter(APPROXIMATE * len(policies))
    fixed = {"fass": FASS, "exact": EXACT}
    return {policy: fixed.get(policy) or next(rest) for policy in policies}


def title(policy):
    return TITLES.get(policy) or policy.replace("approximate-", "Approx. ") + " ms"


def middle(numbers):
    return numbers[len(numbers) // 2]


def read_samples(path):
    """Returns the values of each (metric, policy, N), in ns."""
    samples = collections.defaultdict(list)
    with path.open(newline="") as file:
        for row in csv.DictReader(file):
            key = row["metric"], row["policy"], int(row["subtasks"])
            samples[key].append(int(row["value_ns"]))
    return samples


def save(path):
    plt.savefig(path, metadata={"Date": None})
    plt.close()


def box_plots(samples, metric, label, policies, subtasks, colours, jobs):
    """One panel a number of subtasks, one box a policy, a logarithmic axis."""
    figure, panels = plt.subplots(
        1, len(subtasks), figsize=(10, 4.2), sharey=True, squeeze=False, layout="constrained"
    )
    for panel, parallel in zip(panels[0], subtasks):
        for position, policy in enumerate(policies):
            # A logarithm has no 0; less than 1 ns is not measured anyway.
            values = [max(value, 1) / NS_PER_MS for value in samples[metric, policy, parallel]]
            colour = colours[policy]
            if values:
                panel.boxplot(
                    [values],
                    positions=[position],
                    widths=0.6,
                    whis=(1, 99),
                    showfliers=False,
                    patch_artist=True,
                    boxprops={"facecolor": colour + "55", "edgecolor": colour},
                    medianprops={"color": colour, "linewidth": 2.2},
                    whiskerprops={"color": colour},
                    capprops={"color": colour},
                )
            total = jobs.get((policy, parallel), 0)
            panel.annotate(
                f"{len(values)}\nof {total}",
                (position, 1.0),
                xycoords=("data", "axes fraction"),
                ha="center",
                va="bottom",
                fontsize=7,
                color="#5b6675",
            )
        panel.set_yscale("log")
        panel.set_title(f"N = {parallel}", pad=28, fontweight="bold")
        panel.set_xticks(range(len(policies)), [title(policy) for policy in policies])
        panel.tick_params(axis="x", rotation=38)
        plt.setp(panel.get_xticklabels(), ha="right", rotation_mode="anchor")
        panel.grid(axis="x", visible=False)
    panels[0][0].set_ylabel(f"{label} [ms]")


def distribution(samples, policies, parallel, colours, jobs):
    """Histogram and cumulative distribution of the cover delay."""
    figure, (histogram, cumulative) = plt.subplots(
        1, 2, figsize=(10, 4), layout="constrained"
    )
    everything = [
        max(value, 1) / NS_PER_MS
        for policy in policies
        for value in samples["cover_delay", policy, parallel]
    ]
    low, high = min(everything, default=1), max(everything, default=10)
    steps = 60
    edges = [low * (high / low) ** (step / steps) for step in range(steps + 1)]
    edges[-1] *= 1.001
    for policy in policies:
        values = sorted(
            max(value, 1) / NS_PER_MS for value in samples["cover_delay", policy, parallel]
        )
        if not values:
            continue
        style = {"color": colours[policy], "label": title(policy)}
        histogram.hist(values, bins=edges, histtype="stepfilled", alpha=0.35, color=colours[policy])
        histogram.hist(values, bins=edges, histtype="step", linewidth=1.3, **style)
        total = max(jobs.get((policy, parallel), 0), len(values))
        shares = [(rank + 1) / total for rank in range(len(values))]
        cumulative.step(values, shares, where="post", linewidth=1.6, **style)
    for panel, name in [(histogram, "jobs"), (cumulative, "share of all jobs")]:
        panel.set_xscale("log")
        panel.set_xlabel(f"cover delay [ms], N = {parallel}")
        panel.set_ylabel(name)
    histogram.set_yscale("log")
    cumulative.set_ylim(0, 1.02)
    # Between what joins at once and what waits for messages nothing is drawn.
    cumulative.legend(loc="center", bbox_to_anchor=(0.57, 0.55))


def gantt(out, summary, policies, parallel, colours):
    """A stretch of the run, the same under each policy."""
    seed = summary["seeds"][0]
    found = []
    for policy in policies:
        path = out / "conditions" / f"{policy}-n{parallel}-seed{seed}.csv"
        if path.is_file():
            found.append((policy, read_times(path)))
    begin = PERIOD_NS * min(40, summary["jobs"] // 2)
    end = begin + 14 * PERIOD_NS
    figure, panels = plt.subplots(
        max(len(found), 1),
        1,
        figsize=(10, 0.6 + 0.28 * (parallel + 2) * max(len(found), 1) + 0.35 * len(found)),
        sharex=True,
        squeeze=False,
        layout="constrained",
    )
    for panel, (policy, rows) in zip(panels[:, 0], found):
        draw_schedule(panel, rows, parallel, begin, end, colours[policy])
        panel.set_title(title(policy), loc="left", fontsize=10, fontweight="bold")
    panels[-1, 0].set_xlabel(f"time since the first release [ms], N = {parallel}, seed {seed}")


def read_times(path):
    with path.open(newline="") as file:
        next(file)
        return list(csv.DictReader(file))


def draw_schedule(panel, rows, parallel, begin, end, colour):
    published = {}
    for row in rows:
        if row["what"] != "execution" or row["subtask"] == "0":
            continue
        lane, index = int(row["subtask"]) - 1, int(row["index"])
        start, finish = int(row["start_ns"]), int(row["finish_ns"])
        published[lane, index] = finish
        if finish > begin and start < end:
            shade = ["66", "33"][index % 2]
            panel.barh(
                lane,
                (finish - start) / NS_PER_MS,
                left=start / NS_PER_MS,
                height=0.78,
                color=colour + shade,
                edgecolor=colour,
                linewidth=0.6,
            )
            if min(finish, end) - max(start, begin) > 9e6:
                centre = (max(start, begin) + min(finish, end)) / 2
                panel.text(centre / NS_PER_MS, lane, index, ha="center", va="center", fontsize=7)
    for row in rows:
        if row["what"] != "join" or not begin <= int(row["ready_ns"]) <= end:
            continue
        indices = [int(index) for index in row["joined_indices"].split()]
        ready = int(row["ready_ns"]) / NS_PER_MS
        mark = "#1c2430" if len(set(indices)) == 1 else "#d01c1c"
        for lane, index in enumerate(indices):
            panel.plot(
                [published[lane, index] / NS_PER_MS, ready],
                [lane + 0.39, parallel],
                color=mark,
                linewidth=0.7,
                alpha=0.75,
            )
        panel.plot(ready, parallel, marker="v", color=mark, markersize=6)
    panel.set_xlim(begin / NS_PER_MS, end / NS_PER_MS)
    panel.set_ylim(parallel + 0.5, -0.6)
    panel.set_yticks(range(parallel + 1), [str(n + 1) for n in range(parallel)] + ["join"])
    panel.tick_params(axis="y", labelsize=8)
    panel.grid(axis="y", visible=False)


if __name__ == "__main__":
    main()

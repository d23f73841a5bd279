//! `scripts/convert`: the formats of others, in and out, and what is refused of these. YAML needs
//! PyYAML, so `./scripts/test` leaves out this module where there is none.

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};

use tool::system::workspace;

use crate::support::{Called, call, folder, refusal, succeed};

fn convert(folder: &Path, line: &str) -> Called {
    let mut convert = Command::new(workspace().join("scripts/convert"));
    convert.args(line.split(' ').filter(|word| !word.is_empty()));
    let output = convert.current_dir(folder).stdin(Stdio::null()).output();
    Called::of(output.expect("python3 converts; install it"))
}

/// A name, its content with `/` for a line's end, the options, the result, and words on what is left
/// out or refused. A fork and a join in each format, and what other generators write.
const READ: &str = r#"
old.yaml | links:/- communication_time: 2/  source: 0/  target: 1/nodes:/- execution_time: 4/  id: 0/- deadline: 18/  execution_time: 3/  id: 1/ | | period 18ms deadline 18ms/subtask 0 wcet 4ms/subtask 1 wcet 5ms/edge 0 -> 1/ | old.yaml:2: a `communication_time` is added
older.yaml | nodes:/- Execution_time: 4/  Period: 9/  id: 0/ | | period 9ms deadline 9ms/subtask 0 wcet 4ms/ | older.yaml:2: no deadline of older is given
measured.yaml | nodes:/- id: 0/  execution_time_file: times.txt/  period: 33000/  relative_deadline: 33000/ | --unit 1us | period 33ms deadline 33ms/subtask 0 wcet 4100us samples 4ms,4100us,3900us/ |
extra.yaml | nodes:/- id: 0/  execution_time: 1/  label: cam/  end_to_end_deadline: 25/ | | period 25ms deadline 25ms/subtask 0 wcet 1ms/ | extra.yaml:4: the key `label` of a node is left out
flow.yaml | {nodes: [{id: 0, execution_time: &a 1.0e-05, period: 25}, {id: "x y", execution_time: *a}]} | --unit 1ms | -0 period 25ms deadline 25ms/subtask 0 wcet 10ns//dag flow-x_y period 25ms deadline 25ms/subtask x_y wcet 10ns/ | flow.yaml:1: node `x y` is written `x_y`
third.yaml | nodes:/- id: 0/  execution_time: 3.33333333/  period: 33.33333333/  end_to_end_deadline: 16.66666667/ | | period 33333333ns deadline 16666666ns/subtask 0 wcet 3333334ns/ |
link.json | {"nodes":[{"execution_time":1,"period":25,"id":0},{"execution_time":4,"id":1}],"edges":[{"communication_time":1,"source":0,"target":1}]} | | period 25ms deadline 25ms/subtask 0 wcet 1ms/subtask 1 wcet 5ms/edge 0 -> 1/ | link.json:1: no deadline
twice.json | "{\"nodes\":[{\"id\":0,\"execution_time\":2,\"period\":5}]}" | | period 5ms deadline 5ms/subtask 0 wcet 2ms/ |
gen.dot | strict digraph {/0 [execution_time="1", period=25];/1 [execution_time=4];/0 -> 1 [communication_time=1];/} | | period 25ms deadline 25ms/subtask 0 wcet 1ms/subtask 1 wcet 5ms/edge 0 -> 1/ | gen.dot:4: a `communication_time`
gen.xml | <graphml><key id="d0" for="node" attr.name="execution_time"/>/<graph edgedefault="directed"><node id="0"><data key="d0">3<~data></node>/<node id="1"><data key="d0">1.5<~data></node><edge source="0" target="1"/><~graph><~graphml> | | period 4500us deadline 9ms/subtask 0 wcet 3ms/subtask 1 wcet 1500us/edge 0 -> 1/ | gen.xml:2: no period is given: it is 4500us
graph.tgff | @HYPERPERIOD 0.02/@TASK_GRAPH 0/{/PERIOD 0.02/TASK a TYPE 1/TASK b TYPE 2/ARC c FROM a to b TYPE 0/HARD_DEADLINE d ON b AT 0.015/SOFT_DEADLINE e ON b AT 0.01/}/@PE 0 {/# price/8.5/#---/# type version valid task_time/1 0 1 0.001/2 0 1 0.004/}/@PE 1 {/# type version valid task_time/1 0 0 9/2 0 1 0.002/} | | period 20ms deadline 15ms/subtask a wcet 1ms/subtask b wcet 4ms/edge a -> b/ | graph.tgff:20: tables differ in the time of a type: the longest counts
flow14.json | {"schemaVersion":"1.4","workflow":{"tasks":[{"name":"a","id":"1","runtimeInSeconds":1.5,"children":["b"]},{"name":"b","id":"2","runtime":2,"parents":["1"],"cores":2}]}} | | period 3500ms deadline 3500ms/subtask a wcet 1500ms/subtask b wcet 2s/edge a -> b/ | flow14.json:1: task `b` ran on several cores
flow15.json | {"schemaVersion":"1.5","workflow":{"specification":{"tasks":[{"name":"t","id":"t1","parents":[],"children":["t2"]},/{"name":"t","id":"t2","parents":["t1"],"children":[]}]},"execution":{"tasks":[{"id":"t2","runtimeInSeconds":0},{"id":"t1","runtimeInSeconds":0.25}]}}} | | period 250000001ns deadline 250000001ns/subtask t1 wcet 250ms/subtask t2 wcet 1ns/edge t1 -> t2/ | flow15.json:2: task `t2` has no run time
sim.xml | <simulation duration="1"><sched class="simso.schedulers.EDF"/><processors><processor name="P" id="1"/><~processors>/<tasks><task name="TASK T1" id="1" period="20" activationDate="1" deadline="9.5" WCET="2" followed_by="7" abort_on_miss="yes"/>/<task name="b" id="7" task_type="APeriodic" period="0" deadline="10" WCET="0.5"/><~tasks><~simulation> | | -TASK_T1 period 20ms deadline 19500us offset 1ms/subtask TASK_T1 wcet 2ms/subtask b wcet 500us/edge TASK_T1 -> b/ | sim.xml:1: the machine's 1 processors are left out; state --cores 1
set.yaml | tasks:/- t: 20/  d: 15/  vertices:/  - id: 5/    c: 2/    p: 1/  - id: 6/    c: 3/  edges:/  - from: 5/    to: 6/ | | -0 period 20ms deadline 15ms/subtask 5 wcet 2ms/subtask 6 wcet 3ms/edge 5 -> 6/ | set.yaml:7: the key `p` of a vertex is left out
"#;

#[test]
fn every_format_becomes_ours_and_losses_are_told() {
    let folder = folder("converted");
    fs::write(folder.join("times.txt"), "4000\n4100\n3900\n").expect("a file");
    for row in READ.lines().skip(1) {
        let [file, text, options, dag, said] = row.splitn(5, '|').collect::<Vec<_>>()[..] else {
            panic!("{row}");
        };
        let [file, options, said] = [file, options, said].map(str::trim);
        let lines = |text: &str| {
            text.trim()
                .replace("</node>", "<~node>")
                .replace("/>", "~>")
        };
        let text = lines(text).replace('/', "\n").replace('~', "/");
        fs::write(folder.join(file), text).expect("a file");
        let called = convert(&folder, &format!("{file} {options}"));
        let stem = file.split('.').next().unwrap_or_default();
        let dag = dag.trim().replace('/', "\n");
        let expected = match dag.strip_prefix('-') {
            Some(dag) if file == "sim.xml" => format!("dag {dag}\nend\n"),
            Some(dag) => format!("dag {stem}-{dag}\nend\n"),
            None => format!("dag {stem} {dag}\nend\n"),
        };
        assert_eq!(called.out, expected, "{file}: {}", called.complaint);
        assert!(called.complaint.contains(said), "{}", called.complaint);
        let printed = succeed(
            &folder,
            format!("run --print-dag --dag {file} {options}").trim(),
        );
        assert_eq!(printed, expected, "{file}");
    }
}

/// A name, its content, and the refusal. `N` is a node of RD-Gen's on the lines 1 to 4, and `O`
/// another, called 1, on two more.
const REFUSED: &str = r#"
branch.yaml | N- id: 1/  branch_unit_id: 0/ | :6: `branch_unit_id`: conditional branches are not run
fire.yaml | NOlinks:/- source: 0/  target: 1/  firing_prob: 0.5/ | :10: `firing_prob`: conditional branches are not run
cycle.yaml | NOlinks:/- source: 0/  target: 1/- source: 1/  target: 0/ | :10: dag `cycle` has a cycle: subtask `0` -> subtask `1` -> subtask `0`; remove one
self.yaml | Nlinks:/- source: 0/  target: 0/ | :6: dag `self` has a cycle
key.yaml | N- id: 1/  execution: 4/ | :5: node `1` has no `execution_time`; give it one
file.yaml | nodes:/- id: 0/  execution_time_file: none.txt/ | :3: execution_time_file: `none.txt`: No such file
missing.yaml | NOlinks:/- source: 0/  target: 7/ | :9: target: there is no node `7`; add it
negative.yaml | nodes:/- id: 0/  execution_time: -5/ | :3: execution_time: `-5` is negative
huge.yaml | nodes:/- id: 0/  execution_time: 1e999999999/ | :3: execution_time: `1e999999999` units of 1ms are more than 64 bits
soon.yaml | nodes:/- id: 0/  execution_time: soon/ | :3: execution_time: `soon` is no time
zero.yaml | nodes:/- id: 0/  execution_time: 1/  period: 0/ | :4: period: it is 0; give more
path.yaml | nodes:/- id: 0/  execution_time: 9000000000000/- id: 1/  execution_time: 18000000000000/links:/- source: 0/  target: 1/ | :2: the longest path of dag `path` is more than 64 bits
empty.yaml | | :1: the file is empty
cut.yaml | NOlinks:/- source: 0/ | :8: this link lacks its `source` or its `target`; give both
both.yaml | NOlinks:/- source: 0/  target: 1/edges: []/ | :10: `links` and `edges` both list the edges; keep one
same.yaml | N- id: 0/  execution_time: 1/ | :5: node `0` stands here twice, first on line 2; drop one
link.yaml | NOlinks:/- source: 0/  target: 1/- source: 0/  target: 1/ | :10: the link from `0` to `1` stands here twice, first on line 8; drop one
offset.yaml | NO  offset: 2/links:/- source: 0/  target: 1/ | :5: node `1` has an `offset` and no `period`
open.yaml | nodes: [/ | this is no YAML
tab.yaml | nodes:/	- id: 0/ | :2: this is no YAML
two.yaml | nodes:/nodes:/ | :2: key `nodes` stands here twice; give it once
way.yaml | directed: false/N | :1: `directed` must be true, found `false`
cycle.json | {"graphs":[/{"name":"a","c":[1,2],"edges":[[0,1],[1,0]]}]} | :2: dag `a` has a cycle
amid.json | {"graphs":[/{"name":"a","c":[1,0,4],"edges":[[0,1],[1,2]]}]} | :2: graph `a`: vertex 1 has cost 0 and stands between others
same.json | {"graphs":[/{"name":"a","c":[1]},/{"name":"a","c":[1]}]} | :3: graph `a` stands here twice, first on line 2; drop one
edge.json | {"graphs":[/{"name":"a","c":[1],"edges":[[0,1]]}]} | :2: graph `a`: an edge must be two vertices from 0 to 0
long.json | {"graphs":[/{"name":"a","c":[18446744073709,1]}]} | :2: graph `a`: its costs are more than 64 bits of nanoseconds; choose a shorter unit
other.json | {"apps":1} | :1: the file has no `nodes` (node-link), `graphs` (task graphs) or `workflow`
torn.json | {"graphs":[/{"na | :2: this is no JSON
parent.json | {"workflow":{"tasks":[{"name":"a","runtime":1,"parents":["z"]}]}} | :1: parents: there is no task `z`
type.tgff | @TASK_GRAPH 0 {/PERIOD 1/TASK a TYPE 3/} | :3: task `a`: no table has a time for its type `3`
arc.tgff | @TASK_GRAPH 0 {/PERIOD 1/ARC a FROM b/} | :3: `ARC a FROM b` is no ARC of TGFF
un.dot | graph {/0 -- 1/} | :1: expected `digraph`, found `graph`; an edge needs a direction
sub.dot | digraph {/subgraph x {/0}} | :2: found `subgraph` in place of a name
open.xml | <simulation>/<tasks> | :2: this is no XML: no element found
"#;

#[test]
fn a_refusal_is_a_line_with_its_place() {
    let folder = folder("refused");
    for row in REFUSED.lines().skip(1) {
        let [file, text, words] = row.split(" | ").collect::<Vec<_>>()[..] else {
            panic!("{row}");
        };
        let text = text.trim().replace('/', "\n");
        let node = |name: &str, text: String, node: &str| match file.ends_with(".yaml") {
            true => text.replacen(name, node, 1),
            false => text,
        };
        let text = node(
            "N",
            text,
            "nodes:\n- id: 0\n  execution_time: 1\n  period: 9\n",
        );
        let text = node("O", text, "- id: 1\n  execution_time: 1\n");
        fs::write(folder.join(file), text).expect("a file");
        let said = refusal(&folder, ["run", "--dag", file]);
        let place = format!("run: {file}:");
        assert!(said.starts_with(&place) && said.contains(words), "{said}");
    }
    for (line, words) in [
        ("", "convert: there is no file to convert; name one"),
        ("/no/file.yaml", "convert: `/no/file.yaml`: No such file"),
        ("a.yaml --to csv", "give one of dag, yaml, sag, simso"),
        (
            "cycle.json --unit 0ns",
            "`--unit`: a unit of 0; give at least 1ns",
        ),
        ("cycle.json --to sag", "give -o FILE.csv"),
        ("cycle.json --jobs 2", "unknown option `--jobs`"),
    ] {
        let called = convert(&folder, line);
        assert_eq!(called.code, Some(2), "{line}: {}", called.complaint);
        assert!(called.complaint.contains(words), "{}", called.complaint);
    }
    let help = convert(&folder, "--help");
    assert!(help.code == Some(0) && help.out.contains("usage: ./scripts/convert FILE"));
}

const SET: &str = "dag cam period 20ms deadline 15ms offset 5ms\nsubtask a wcet 2ms priority 1\n\
    subtask b wcet 3ms priority 2\nsubtask c wcet 1500us wait 1ms wcet 500us priority 3\n\
    edge a -> b\nedge a -> c\n\ndag rate period 10ms\nsubtask one wcet 4ms priority 0\nend\n";

#[test]
fn what_goes_out_comes_back_or_is_told() {
    let folder = folder("out");
    fs::write(folder.join("set.dag"), SET).expect("a file");
    let said = convert(&folder, "set.dag --to yaml -o set.yaml").complaint;
    let lost = [
        "set.dag:1: offsets are left out",
        "set.dag:2: priorities are left out",
        "set.dag:4: a subtask's waits count as execution",
        "one unit is 1ms: read it back with --unit 1ms",
    ];
    assert!(lost.iter().all(|words| said.contains(words)), "{said}");
    let plain = SET
        .replace(" offset 5ms", "")
        .replace("1500us wait 1ms wcet 500us", "3ms");
    let plain = plain.replace("rate period 10ms", "rate period 10ms deadline 10ms");
    let plain = (0..4).fold(plain, |text, n| text.replace(&format!(" priority {n}"), ""));
    let plain = plain.replace("4ms\nend", "4ms\n\nend");
    assert_eq!(convert(&folder, "set.yaml --unit 1ms").out, plain);

    let said = convert(&folder, "set.dag --to simso --cores 2 -o set.xml").complaint;
    assert!(said.contains("dag `cam` becomes one task"), "{said}");
    let back = "dag cam period 20ms deadline 15ms offset 5ms\nsubtask cam wcet 8ms\n\n\
                dag rate period 10ms deadline 10ms\nsubtask rate wcet 4ms\n\nend\n";
    let again = convert(&folder, "set.xml");
    assert_eq!(again.out, back);
    assert!(again.complaint.contains("state --cores 2"));

    // Jobs until the latest offset and two hyperperiods: 3 of four, and 5 of one.
    let said = convert(&folder, "set.dag --to sag -o set.csv").complaint;
    assert!(said.contains("jobs released before 45ms"), "{said}");
    let table = |name: &str| fs::read_to_string(folder.join(name)).expect("a table");
    let (jobs, edges) = (table("set.csv"), table("set.prec.csv"));
    let rows: Vec<&str> = jobs.lines().collect();
    assert_eq!(
        (rows.len(), edges.lines().count()),
        (1 + 2 * 3 + 5, 1 + 2 * 2)
    );
    assert_eq!(rows[4], "1, 4, 25000000, 25000000, 0, 2000000, 40000000, 1");
    assert_eq!(
        rows[11],
        "4, 11, 40000000, 40000000, 0, 4000000, 50000000, 0"
    );
    assert!(edges.ends_with("1, 4, 2, 5\n1, 4, 3, 6\n"), "{edges}");
}

#[test]
fn the_copies_of_generated_files_are_what_the_converter_writes() {
    let examples = workspace().join("apps/dag-file/examples");
    let files = fs::read_dir(examples.join("rd-gen"))
        .expect("a folder")
        .flatten();
    let mut count = 0;
    for file in files {
        let path = file.path();
        let copy = examples
            .join("converted")
            .join(file.file_name())
            .with_extension("dag");
        let written = convert(&examples, path.to_str().expect("UTF-8")).out;
        assert_eq!(
            fs::read_to_string(copy).expect("a copy"),
            written,
            "{}",
            path.display()
        );
        count += 1;
    }
    assert_eq!(count, 24);
}

#[test]
fn a_workflow_of_1004_tasks_and_ten_thousand_nodes_are_read() {
    let folder = folder("large");
    let task = |n: usize| {
        let parent = format!("\"t{}\"", n.saturating_sub(1));
        let parents = if n == 0 { "" } else { &parent };
        format!("{{\"name\":\"t{n}\",\"runtimeInSeconds\":0.5,\"parents\":[{parents}]}}")
    };
    let tasks: Vec<String> = (0..1004).map(task).collect();
    let text = format!("{{\"workflow\":{{\"tasks\":[{}]}}}}", tasks.join(",\n"));
    fs::write(folder.join("flow.json"), text).expect("a file");
    let nodes = (0..10_000).map(|number| format!("- id: {number}\n  execution_time: 1\n"));
    let text = format!("nodes:\n{}", nodes.collect::<String>());
    fs::write(folder.join("many.yaml"), text).expect("a file");
    for (file, subtasks) in [("flow.json", 1004), ("many.yaml", 10_000)] {
        let printed = succeed(&folder, &format!("run --print-dag --dag {file}"));
        assert_eq!(printed.matches("\nsubtask ").count(), subtasks, "{file}");
    }
}

/// Damages files, each 200 times, and converts them: only a refusal with a line of the file may come
/// of it, or a conversion that our reader takes.
const DAMAGE: &str = r#"
import importlib.machinery, importlib.util, random, sys
loader = importlib.machinery.SourceFileLoader("convert", sys.argv[1])
module = importlib.util.module_from_spec(importlib.util.spec_from_loader("convert", loader))
loader.exec_module(module)
for path in sys.argv[2:]:
    good = open(path).read()
    for seed in range(200):
        chance = random.Random(seed)
        at = chance.randrange(len(good))
        to = min(len(good), at + chance.randrange(12))
        text = chance.choice([good[:at] + good[to:], good[:at] + good[at:to] * 2 + good[to:], good[:at],
                              good[:at] + chance.choice("-#\n9 '\"{[<&:}") + good[at:]])
        job = module.Job()
        job.path = path
        try:
            converted = module.convert(job, text)[0]
            module.ours(job, converted)
        except module.Refused as refused:
            line, why = refused.args
            last = text.count("\n") + 1
            assert 0 <= line <= last and why and "\n" not in why, (path, seed, line, why)
        except Exception as error:
            raise AssertionError(f"{path}, seed {seed}: {text}") from error
print("well")
"#;

#[test]
fn no_damage_to_a_file_is_more_than_a_refusal() {
    let folder = folder("damaged");
    let mut files: Vec<String> = Vec::new();
    for row in READ.lines().skip(1) {
        let [file, text, ..] = row.splitn(5, '|').collect::<Vec<_>>()[..] else {
            panic!("{row}");
        };
        let text = text.replace("</node>", "<~node>").replace("/>", "~>");
        let text = text.trim().replace('/', "\n").replace('~', "/");
        fs::write(folder.join(file.trim()), text + "\n").expect("a file");
        files.push(file.trim().into());
    }
    fs::write(folder.join("times.txt"), "4000\n").expect("a file");
    fs::write(folder.join("set.dag"), SET).expect("a file");
    files.push("set.dag".into());
    let mut python = Command::new("python3");
    python
        .arg("-Bc")
        .arg(DAMAGE)
        .arg(workspace().join("scripts/convert"));
    let output = python.args(&files).current_dir(&folder).output();
    let called = Called::of(output.expect("python3; install it"));
    assert_eq!(called.out, "well\n", "{}", called.complaint);
    // As a person sees one.
    fs::write(folder.join("torn.json"), "[[[[").expect("a file");
    let said = call(&folder, ["run", "--dag", "torn.json"]).complaint;
    assert_eq!(said.lines().count(), 1, "{said}");
}

(** * The model: lists that are enforced on cores, and their runs

    Words. A _place_ is a core and an index in that core's endless list. A _table_ gives each place a WCET,
    a start, a finish, a nominal release and a depth, and says which places it waits for. A _run_ is a
    sequence of steps by the rules T1 to T4 of sched-dag/src/table.rs. Time is discrete (a nanosecond, say).

    What the rules leave open is open here: any order of what happens at one instant; any entry may end at any
    time after its start; a place may be void from any time on. What is against the rules is counted, in [lost]: by how
    much executions exceed their WCETs, and each unit of time in which a core does not do what it should. *)

From Coq Require Import ZArith List Bool.
Import ListNotations.
Open Scope Z_scope.

Definition place : Set := (nat * nat)%type.

(** An endless table. [before p y]: the entry at [y] waits for the entry at [p] (an edge of its job, or the same
    subtask of the job before); [wait p y]: for how long at most [y] has to wait after that one has ended (0 for a plain edge). *)
Record table := {
  cores : nat;
  wcet : place -> Z;
  start : place -> Z;
  finish : place -> Z;
  release : place -> Z;
  depth : place -> Z;
  before : place -> place -> Prop;
  wait : place -> place -> Z
}.

(** What happens from outside: at which times a place's job has been released, and at which times the place is
    void (its job does not exist, was skipped or cut before this entry started, or its DAG has ended). *)
Record environment := {
  released : place -> Z -> bool;
  void : place -> Z -> bool
}.

(** [position k]: the index of the next entry of core [k]. [stack k]: what has begun there and not ended, the
    running one first, each with what is left of its WCET. [lost]: by how much WCETs have been exceeded, in sum, plus the
    number of units of time in which any core was held up. [ended p]: when the entry at [p] ended or was passed, if it has. *)
Record state := {
  now : Z;
  lost : Z;
  position : nat -> nat;
  stack : nat -> list (nat * Z);
  ended : place -> Z
}.

Definition next (s : state) (k : nat) : place := (k, position s k).

Definition started (s : state) (p : place) : Prop := (snd p < position s (fst p))%nat.

(** Ended, or passed. *)
Definition finished (s : state) (p : place) : Prop :=
  started s p /\ ~ In (snd p) (map fst (stack s (fst p))).

Definition set {A} (f : nat -> A) (k : nat) (a : A) : nat -> A := fun j => if Nat.eqb j k then a else f j.

Definition set_place {A} (f : place -> A) (p : place) (a : A) : place -> A :=
  fun q => if (Nat.eqb (fst q) (fst p) && Nat.eqb (snd q) (snd p))%bool then a else f q.

(** The running entry has used one unit of time. *)
Definition spend (st : list (nat * Z)) : list (nat * Z) :=
  match st with [] => [] | (x, w) :: below => (x, w - 1) :: below end.

Section Rules.
Variable tb : table.
Variable env : environment.

(** The place of an entry: it is the next one of its core, and the top of the stack, if any, has a smaller depth. *)
Definition room (s : state) (k : nat) : Prop :=
  match stack s k with [] => True | (x, _) :: _ => depth tb (k, x) < depth tb (next s k) end.

(** A list without nesting. *)
Definition plain (k : nat) : Prop := forall i j, depth tb (k, i) = depth tb (k, j).

(** The next entry of core [k] may not be kept waiting: it is at its place, and it is void and its nominal release has
    come, or it is released and all that it waits for has ended or was passed, and its waits are over. (Were what is void
    due before, time would stop for a DAG that has ended: all of its entries to come are void at once.) *)
Definition due (s : state) (k : nat) : Prop :=
  room s k /\
  (release tb (next s k) <= now s /\ void env (next s k) (now s) = true \/
   released env (next s k) (now s) = true /\
   forall p, before tb p (next s k) -> finished s p /\ ended s p + wait tb p (next s k) <= now s).

(** Time may go on: nothing is due on any core, and nothing runs that has nothing left. *)
Definition quiet (s : state) : Prop :=
  forall k, (k < cores tb)%nat ->
    ~ due s k /\ match stack s k with [] => True | (_, w) :: _ => 0 < w end.

(** - [Start]: an entry starts at its place, on top of the stack. (The rules let it start only if it is released and what
      it waits for has ended, or is void. The theorem does not need that: every run by T1 to T4 is a run here, whether
      what is void counts as ended at once or when it is passed.)
    - [Pass]: a void entry is passed, only where it might start; in a plain list, at any time.
    - [End]: an entry that has begun ends, or is cut; whether it runs or is preempted.
    - [Exceed]: an entry that has begun will take one unit more than was left.
    - [Tick]: one unit of time; on each core the top of the stack runs.
    - [Stall]: one unit of time in which some cores, or all, are held up: what is due waits, what runs stands still. It counts
      once, on however many cores. *)
Inductive step : state -> state -> Prop :=
| Start : forall s k, (k < cores tb)%nat -> room s k ->
    step s {| now := now s; lost := lost s; position := set (position s) k (S (position s k));
              stack := set (stack s) k ((position s k, wcet tb (next s k)) :: stack s k); ended := ended s |}
| Pass : forall s k, (k < cores tb)%nat -> room s k \/ plain k -> void env (next s k) (now s) = true ->
    step s {| now := now s; lost := lost s; position := set (position s) k (S (position s k));
              stack := stack s; ended := set_place (ended s) (next s k) (now s) |}
| End : forall s k above x w below, (k < cores tb)%nat -> stack s k = above ++ (x, w) :: below ->
    step s {| now := now s; lost := lost s; position := position s;
              stack := set (stack s) k (above ++ below); ended := set_place (ended s) (k, x) (now s) |}
| Exceed : forall s k above x w below, (k < cores tb)%nat -> stack s k = above ++ (x, w) :: below ->
    step s {| now := now s; lost := lost s + 1; position := position s;
              stack := set (stack s) k (above ++ (x, w + 1) :: below); ended := ended s |}
| Tick : forall s, quiet s ->
    step s {| now := now s + 1; lost := lost s; position := position s;
              stack := fun k => spend (stack s k); ended := ended s |}
| Stall : forall s stacks, (forall k, stacks k = stack s k \/
      match stack s k with [] => True | (_, w) :: _ => 0 < w end /\ stacks k = spend (stack s k)) ->
    step s {| now := now s + 1; lost := lost s + 1; position := position s; stack := stacks; ended := ended s |}.

Inductive run : state -> state -> Prop :=
| Stay : forall s, run s s
| Go : forall s t u, run s t -> step t u -> run s u.

End Rules.

Definition initial : state := {| now := 0; lost := 0; position := fun _ => O; stack := fun _ => []; ended := fun _ => 0 |}.

(** Each job is released, or void, at the latest [late] after its nominal release. *)
Definition punctual (tb : table) (env : environment) (late : Z) : Prop :=
  forall y t, (fst y < cores tb)%nat -> release tb y + late <= t ->
    released env y t = true \/ void env y t = true.

(** * Sporadic DAGs on m cores, and a job of them as a job among others

    K DAGs are released sporadically and scheduled globally.  A policy says which jobs may delay which: those of
    DAGs that outrank another one's (static priorities), or also only those with a deadline no later (EDF).

    A subtask that waits for devices is several vertices in a row, its segments and its waits.

    Some subtasks may keep their cores: such a one, once started, executes until it ends, whoever else waits.

    Left out here: jobs of one DAG in flight together (R > T), pinned subtasks, and what Model.v leaves out.
    Other work may be there if it gives up its core as soon as an instance of these DAGs is ready. *)

Require Import Arith Lia Bool List.
From Bounds Require Import Sums Model Chains Shares OneTick Account ResponseTime Workload.

Record task := {
  graph : dag;
  wcet : nat -> nat;
  head : nat -> nat;    (* the vertex with which it shares a WCET: itself, if its own is known (Shares.v) *)
  together : nat -> nat;(* of a head the most that all which share with it execute; else of no matter, as 0 *)
  waits : nat -> bool;  (* whether a vertex is a wait for a device, of [wcet] at most, on no core *)
  keeps : nat -> bool;  (* whether a vertex, once it executes, keeps its core until it ends *)
  regular : bool;       (* whether its jobs execute to their ends, and by rank; else they may be aborted or stopped *)
  known : bool;         (* whether WCETs are known; else nothing is said of how long its subtasks execute *)
  period : nat;         (* the least time from a release to the next *)
  deadline : nat;       (* relative, of the whole job *)
  first_deadline : nat  (* the least relative deadline of a vertex: the same, if sinks have none of their own *)
}.

(** [outranks h k]: jobs of DAG h may win over jobs of DAG k; [by_deadline]: only if something of them is due
    no later than the other job. *)
Record policy := {
  by_deadline : bool;
  outranks : nat -> nat -> bool
}.

(** A run of all tasks: job n of task k is released at [release k n]; its vertex v executes for
    [job_exec k n v] ticks, and in tick t just if [executes t k n v].  [lost t]: in tick t the platform takes time
    of its own, on *any* core, as far as it is not in WCETs.  (A task with finitely many jobs is one whose further jobs are
    released after all that is looked at.) *)
Record set_run := {
  release : nat -> nat -> nat;
  job_exec : nat -> nat -> nat -> nat;
  executes : nat -> nat -> nat -> nat -> bool;
  lost : nat -> bool
}.

Definition job_done (s : set_run) (t k n v : nat) : nat := count t (fun i => executes s i k n v).

Definition job_finished (s : set_run) (t k n v : nat) : Prop := job_exec s k n v <= job_done s t k n v.

(** R4: a job is complete when all of it has finished. *)
Definition job_complete (tau : nat -> task) (s : set_run) (t k n : nat) : Prop :=
  forall v, v < size (graph (tau k)) -> job_finished s t k n v.

(** R2: an instance is ready when its job is released, all that precedes it in the same job has finished, and
    the same vertex of all earlier jobs has. *)
Definition instance_ready (tau : nat -> task) (s : set_run) (t k n v : nat) : Prop :=
  v < size (graph (tau k)) /\ release s k n <= t /\ ~ job_finished s t k n v /\
  (forall u, precedes (graph (tau k)) u v -> job_finished s t k n u) /\
  (forall n', n' < n -> job_finished s t k n' v).

(** All earlier jobs of DAG k are complete. *)
Definition earlier_complete (tau : nat -> task) (s : set_run) (t k n : nat) : Prop :=
  forall n', n' < n -> job_complete tau s t k n'.

(** Cores that execute a job, and a task, in tick t.  Job n is released at n or later, so the jobs
    0 .. t are all that may execute in tick t. *)
Definition on_core (tau : nat -> task) (k v : nat) : bool := negb (waits (tau k) v).

Definition job_cores (tau : nat -> task) (s : set_run) (t k n : nat) : nat :=
  count (size (graph (tau k))) (fun v => on_core tau k v && executes s t k n v).

Definition task_cores (tau : nat -> task) (s : set_run) (t k : nat) : nat :=
  sum (S t) (job_cores tau s t k).

Arguments task_cores : simpl never.
Arguments job_cores : simpl never.

(** Job n' of DAG h may delay job n of DAG k, another one. *)
Definition may_delay (tau : nat -> task) (pol : policy) (s : set_run) (k n h n' : nat) : bool :=
  outranks pol h k &&
  (negb (by_deadline pol) ||
   (release s h n' + first_deadline (tau h) <=? release s k n + deadline (tau k))).

(** The cores that execute some of a DAG's jobs. *)
Definition cores_of_jobs (tau : nat -> task) (s : set_run) (jobs : nat -> bool) (t h : nat) : nat :=
  sum (S t) (fun n => if jobs n then job_cores tau s t h n else 0).
Arguments cores_of_jobs : simpl never.

(** Vertex v of job n of DAG k has executed before tick t. *)
Definition has_begun (s : set_run) (t k n v : nat) : bool := 0 <? job_done s t k n v.

(** It has a core in tick t: it executes, or keeps a core and is interrupted. *)
Definition holds_core (tau : nat -> task) (s : set_run) (t k n v : nat) : bool :=
  executes s t k n v ||
  keeps (tau k) v && has_begun s t k n v && (job_done s t k n v <? job_exec s k n v).

Definition cores_held (tau : nat -> task) (s : set_run) (t k : nat) : nat :=
  sum (S t) (fun n => count (size (graph (tau k))) (fun v => on_core tau k v && holds_core tau s t k n v)).

(** Job n' of DAG h may execute although job n of DAG k waits: it is of the same DAG, or may delay it. *)
Definition may_pass (tau : nat -> task) (pol : policy) (s : set_run) (k n h n' : nat) : Prop :=
  h = k \/ may_delay tau pol s k n h n' = true.

Record global_run (K m : nat) (tau : nat -> task) (pol : policy) (s : set_run) : Prop := {
  periods_positive : forall k, k < K -> 0 < period (tau k);
  sporadic : forall k n, k < K -> release s k n + period (tau k) <= release s k (S n);
  (** Only the answer to a wait may be there at once. *)
  executions : forall k n v, k < K -> v < size (graph (tau k)) ->
    (waits (tau k) v = false -> regular (tau k) = true -> 0 < job_exec s k n v) /\
    (known (tau k) = true -> job_exec s k n v <= wcet (tau k) v);
  shared_executions : forall k n v, k < K -> v < size (graph (tau k)) -> known (tau k) = true ->
    sum (size (graph (tau k))) (fun u => if head (tau k) u =? v then job_exec s k n u else 0) <= together (tau k) v;
  (** R1, R2, R3 *)
  only_ready_execute : forall t k n v, k < K -> v < size (graph (tau k)) ->
    executes s t k n v = true -> instance_ready tau s t k n v;
  cores : forall t, sum K (cores_held tau s t) <= m;
  (** R5: save in lost ticks, while an instance is ready and does not execute, all m cores execute, and what
      executes may pass it or keeps its core.  This and the next rules are asked only where earlier jobs are
      complete: by W3 the first segment of a subtask stays behind its *last* one in the job before. *)
  dispatch : forall t k n v, k < K -> regular (tau k) = true -> waits (tau k) v = false -> lost s t = false ->
    instance_ready tau s t k n v -> earlier_complete tau s t k n -> executes s t k n v = false ->
    sum K (task_cores tau s t) = m /\
    forall h n' w, h < K -> w < size (graph (tau h)) -> waits (tau h) w = false ->
      executes s t h n' w = true -> may_pass tau pol s k n h n' \/ keeps (tau h) w = true;
  (** R5: while an instance waits to begin, of what keeps its core only that begins which may pass it. *)
  begin_in_order : forall t k n v, k < K -> regular (tau k) = true -> waits (tau k) v = false ->
    instance_ready tau s t k n v -> earlier_complete tau s t k n -> has_begun s t k n v = false -> executes s t k n v = false ->
    forall h n' w, h < K -> w < size (graph (tau h)) -> waits (tau h) w = false -> keeps (tau h) w = true ->
      has_begun s t h n' w = false -> executes s t h n' w = true -> may_pass tau pol s k n h n';
  (** R5: save in lost ticks, what keeps its core and has begun executes until it ends. *)
  keeps_core : forall t k n v, k < K -> v < size (graph (tau k)) -> waits (tau k) v = false ->
    keeps (tau k) v = true -> lost s t = false ->
    has_begun s t k n v = true -> ~ job_finished s t k n v -> executes s t k n v = true;
  (** A wait needs nobody: it goes on in each tick until it is over. *)
  waits_go_on : forall t k n v, k < K -> regular (tau k) = true -> waits (tau k) v = true ->
    instance_ready tau s t k n v -> earlier_complete tau s t k n -> executes s t k n v = true
}.

Lemma executing_is_held tau s t k : task_cores tau s t k <= cores_held tau s t k.
Proof.
  apply sum_le. intros n _. apply sum_le. intros v _. unfold holds_core.
  destruct (on_core tau k v), (executes s t k n v); simpl; lia.
Qed.

Lemma cores_at_most K m tau pol s t : global_run K m tau pol s -> sum K (task_cores tau s t) <= m.
Proof.
  intros rules. apply Nat.le_trans with (2 := cores _ _ _ _ _ rules t).
  apply sum_le. intros k _. apply executing_is_held.
Qed.

(** ** A job of the set as a job among others *)

Section one_job.
Variables (K m : nat) (tau : nat -> task) (pol : policy) (s : set_run).
Hypothesis rules : global_run K m tau pol s.

(** Its time begins at its release.  Others are all other jobs while one of its vertices waits, and all cores if
    the tick is lost. *)
Definition job_alone (k n : nat) : run := {|
  exec := job_exec s k n;
  runs := fun t v => executes s (release s k n + t) k n v;
  others := fun _ => 0
|}.

Definition job_run (k n : nat) : run := {|
  exec := exec (job_alone k n);
  runs := runs (job_alone k n);
  others := fun t =>
    if somebody_waits (graph (tau k)) (job_alone k n) t
    then if lost s (release s k n + t) then m
         else sum K (task_cores tau s (release s k n + t)) - job_cores tau s (release s k n + t) k n
    else 0
|}.

Lemma releases_apart k n d : k < K -> release s k n + d * period (tau k) <= release s k (n + d).
Proof.
  intros Hk. induction d.
  - replace (n + 0) with n by lia. lia.
  - rewrite Nat.add_succ_r, Nat.mul_succ_l. pose proof (sporadic _ _ _ _ _ rules k (n + d) Hk). lia.
Qed.

Lemma release_at_least k n : k < K -> n <= release s k n.
Proof.
  intros Hk. induction n; [lia|].
  pose proof (sporadic _ _ _ _ _ rules k n Hk). pose proof (periods_positive _ _ _ _ _ rules k Hk). lia.
Qed.

Lemma not_before_release t k n v :
  k < K -> v < size (graph (tau k)) -> t < release s k n -> executes s t k n v = false.
Proof.
  intros Hk Hv Ht. destruct (executes s t k n v) eqn:E; auto.
  apply (only_ready_execute _ _ _ _ _ rules) in E; auto. destruct E as (_ & H & _). lia.
Qed.

Lemma job_done_in_run t k n v :
  k < K -> v < size (graph (tau k)) -> done (job_run k n) t v = job_done s (release s k n + t) k n v.
Proof.
  intros Hk Hv. unfold done, job_done, count. simpl.
  rewrite (sum_shift (release s k n) t), (sum_zero (release s k n)); [reflexivity|].
  intros i Hi. rewrite not_before_release; auto.
Qed.

Lemma job_finished_in_run t k n v :
  k < K -> v < size (graph (tau k)) ->
  (finished (job_run k n) t v <-> job_finished s (release s k n + t) k n v).
Proof.
  intros Hk Hv. unfold finished, job_finished. rewrite job_done_in_run; auto. simpl. tauto.
Qed.

Lemma job_finished_later t t' k n v : t <= t' -> job_finished s t k n v -> job_finished s t' k n v.
Proof.
  unfold job_finished, job_done, count. intros H F.
  pose proof (sum_more t t' (fun i => Nat.b2n (executes s i k n v)) H). lia.
Qed.

Lemma job_among_all t k n : k < K -> job_cores tau s t k n <= sum K (task_cores tau s t).
Proof.
  intros Hk. apply Nat.le_trans with (2 := sum_term K (task_cores tau s t) k Hk).
  destruct (le_lt_dec n t) as [H|H].
  - apply (sum_term (S t) (job_cores tau s t k)). lia.
  - apply Nat.le_trans with 0; [|lia]. apply Nat.eq_le_incl. apply sum_zero. intros v Hv.
    rewrite not_before_release; auto; [rewrite andb_false_r; auto|].
    pose proof (release_at_least k n Hk). lia.
Qed.

(** A vertex executes for one job at a time. *)
Lemma earlier_jobs_finished k v n t :
  k < K -> v < size (graph (tau k)) -> executes s t k n v = true ->
  forall n', n' < n -> job_finished s t k n' v.
Proof.
  intros Hk Hv E. apply (only_ready_execute _ _ _ _ _ rules) in E; auto. destruct E as (_ & _ & _ & _ & P). exact P.
Qed.

Lemma earlier_complete_later t t' k n : t <= t' -> earlier_complete tau s t k n -> earlier_complete tau s t' k n.
Proof. intros H C n' Hn v Hv. apply job_finished_later with t; auto. apply C; auto. Qed.

Lemma one_job_executes k v n n' t :
  k < K -> v < size (graph (tau k)) ->
  executes s t k n v = true -> executes s t k n' v = true -> n = n'.
Proof.
  assert (H : forall n n', k < K -> v < size (graph (tau k)) ->
    executes s t k n v = true -> executes s t k n' v = true -> ~ n < n').
  { intros a b Hk Hv Ea Eb L. apply (only_ready_execute _ _ _ _ _ rules) in Ea; auto.
    destruct Ea as (_ & _ & N & _). apply N. apply (earlier_jobs_finished k v b t Hk Hv Eb a L). }
  intros Hk Hv E E'. pose proof (H n n' Hk Hv E E'). pose proof (H n' n Hk Hv E' E). lia.
Qed.

Lemma job_cores_in_run t k n :
  job_cores tau s (release s k n + t) k n <= busy (graph (tau k)) (job_run k n) t.
Proof.
  apply sum_le. intros v _. simpl. destruct (on_core tau k v), (executes s (release s k n + t) k n v);
    simpl; lia.
Qed.

Lemma some_jobs jobs t h : cores_of_jobs tau s jobs t h <= task_cores tau s t h.
Proof. apply sum_le. intros n _. destruct (jobs n); lia. Qed.

(** If earlier jobs are complete at its release, the rules for one job among others hold. *)
Lemma job_run_legal k n :
  k < K -> regular (tau k) = true -> earlier_complete tau s (release s k n) k n ->
  legal (graph (tau k)) m (job_run k n).
Proof.
  intros Hk Reg Before. constructor.
  - intros t v Hv E. simpl in E.
    apply (only_ready_execute _ _ _ _ _ rules) in E; auto. destruct E as (_ & _ & N & P & _).
    split; [auto|]. split.
    + rewrite job_finished_in_run; auto.
    + intros u Eu. pose proof (precedes_up _ _ _ Eu). apply job_finished_in_run; auto. lia.
  - intros t v (Hv & N & P) E. simpl in E.
    assert (Rd : instance_ready tau s (release s k n + t) k n v).
    { split; [auto|]. split; [lia|]. split; [rewrite <- job_finished_in_run; auto|]. split.
      - intros u Eu. pose proof (precedes_up _ _ _ Eu). apply job_finished_in_run; auto. lia.
      - intros n' Hn. apply job_finished_later with (release s k n); [lia|]. apply (Before n' Hn); auto. }
    assert (Bt : earlier_complete tau s (release s k n + t) k n)
      by (apply earlier_complete_later with (release s k n); [lia|auto]).
    destruct (waits (tau k) v) eqn:Wv.
    { rewrite (waits_go_on _ _ _ _ _ rules _ k n v Hk Reg Wv Rd Bt) in E. discriminate. }
    pose proof (job_cores_in_run t k n) as B.
    pose proof (job_among_all (release s k n + t) k n Hk).
    unfold others, job_run. fold (job_run k n).
    assert (Wt : somebody_waits (graph (tau k)) (job_alone k n) t = true).
    { apply somebody_waits_true. exists v. split; [|exact E]. split; [auto|]. split; [exact N|exact P]. }
    rewrite Wt. destruct (lost s (release s k n + t)) eqn:Lo; [lia|].
    destruct (dispatch _ _ _ _ _ rules _ k n v Hk Reg Wv Lo Rd Bt E) as (D & _). lia.
Qed.

(** ** DAGs that have kept their bounds so far *)

Lemma job_complete_later t t' k n : t <= t' -> job_complete tau s t k n -> job_complete tau s t' k n.
Proof. intros H C v Hv. apply job_finished_later with t; auto. Qed.

(** Each job of DAG k whose bound R ends before [now] is complete by then. *)
Definition kept_before (now k R : nat) : Prop :=
  forall n, release s k n + R < now -> job_complete tau s (release s k n + R) k n.

Section kept.
Variables (now k R : nat).
Hypothesis in_K : k < K.
Hypothesis wcets_known : known (tau k) = true.
Hypothesis is_regular : regular (tau k) = true.
Hypothesis heads : heads_first (graph (tau k)) (head (tau k)).
Hypothesis heads_execute : forall v, v < size (graph (tau k)) -> on_core tau k (head (tau k) v) = on_core tau k v.
Hypothesis kept : kept_before now k R.
Hypothesis in_time : R <= period (tau k).

Lemma kept_legal n : release s k n < now -> legal (graph (tau k)) m (job_run k n).
Proof.
  intros Hn. apply job_run_legal; auto. intros n' Hn'.
  pose proof (releases_apart k n' (n - n') in_K) as Ap. replace (n' + (n - n')) with n in Ap by lia.
  destruct (n - n') as [|d] eqn:Ed; [lia|]. rewrite Nat.mul_succ_l in Ap.
  apply job_complete_later with (release s k n' + R); [lia|]. apply kept. lia.
Qed.

(** What executes of a job executes between its release and R later. *)
Lemma kept_support t n v :
  t < now -> v < size (graph (tau k)) -> executes s t k n v = true ->
  release s k n <= t < release s k n + R.
Proof.
  intros Ht Hv E. apply (only_ready_execute _ _ _ _ _ rules) in E; auto.
  destruct E as (_ & H & N & _). split; auto.
  destruct (lt_dec t (release s k n + R)); auto. exfalso. apply N.
  apply job_finished_later with (release s k n + R); [lia|]. apply kept; auto. lia.
Qed.

(** Of its jobs only [jobs] are looked at.  If there is a [cut], they are due no later than another job of the
    relative deadline Dk, which is released at [a]. *)
Variables (jobs : nat -> bool) (a : nat) (cut : option (nat * nat)).
Hypothesis due : match cut with
  | None => True
  | Some (Dk, D) => forall n, jobs n = true -> release s k n + D <= a + Dk
  end.

(** The cores that execute, of job n if it counts, the vertices in p. *)
Definition part_cores (p : nat -> bool) (t n : nat) : nat :=
  if jobs n then count (size (graph (tau k))) (fun v => p v && executes s t k n v) else 0.

Lemma part_support p t n :
  t < now -> 0 < part_cores p t n -> release s k n <= t < release s k n + R.
Proof.
  unfold part_cores. intros Ht H. destruct (jobs n); [|lia].
  apply sum_positive in H. destruct H as (v & Hv & E).
  apply kept_support with v; auto. destruct (p v), (executes s t k n v); simpl in E; auto; lia.
Qed.

Lemma all_cores t n :
  (if jobs n then job_cores tau s t k n else 0) = part_cores (on_core tau k) t n.
Proof. reflexivity. Qed.

(** A part of the DAG is whole if it has the head of each of its vertices. *)
Definition is_whole (p : nat -> bool) : Prop :=
  forall v, v < size (graph (tau k)) -> p v = true -> p (head (tau k) v) = true.

(** A job executes each of its vertices for the WCET at most, in all. *)
Lemma work_of_part n l p : is_whole p ->
  sum l (fun t => part_cores p t n) <= weight (graph (tau k)) (together (tau k)) p.
Proof.
  intros Whole. apply Nat.le_trans with (weight (graph (tau k)) (job_exec s k n) p).
  2: { apply (shared_weight _ (head (tau k)) heads); auto.
       intros b Hb. apply (shared_executions _ _ _ _ _ rules); auto. }
  unfold part_cores. destruct (jobs n); [|rewrite sum_zero; [lia|auto]].
  unfold count. rewrite sum_swap. apply sum_le. intros v Hv.
  destruct (p v); simpl; [|rewrite sum_zero; auto].
  change (job_done s l k n v <= job_exec s k n v).
  induction l.
  - unfold job_done, count. simpl. lia.
  - change (job_done s l k n v + Nat.b2n (executes s l k n v) <= job_exec s k n v).
    destruct (executes s l k n v) eqn:E; simpl; [|lia].
    apply (only_ready_execute _ _ _ _ _ rules) in E; auto. destruct E as (_ & _ & N & _).
    unfold job_finished in N. lia.
Qed.

(** [w] cores are enough for a job: m always are, and as many as chains that cover its graph. *)
Definition enough_cores (w : nat) : Prop := w = m \/ exists f, chain_cover (graph (tau k)) w f.

Lemma kept_width t n w : t < now -> enough_cores w -> job_cores tau s t k n <= w.
Proof.
  intros Ht C. destruct (Nat.eq_dec (job_cores tau s t k n) 0) as [Z|Z]; [lia|].
  assert (H : release s k n <= t < release s k n + R).
  { apply Nat.neq_0_lt_0, sum_positive in Z. destruct Z as (v & Hv & E).
    apply kept_support with v; auto. destruct (on_core tau k v), (executes s t k n v); simpl in E; auto; lia. }
  destruct C as [->|(f & C)].
  - assert (job_cores tau s t k n <= task_cores tau s t k).
    { apply (sum_term (S t) (job_cores tau s t k)). pose proof (release_at_least k n in_K). lia. }
    pose proof (sum_term K (task_cores tau s t) k in_K).
    pose proof (cores_at_most K m tau pol s t rules). lia.
  - assert (L : legal (graph (tau k)) m (job_run k n)) by (apply kept_legal; lia).
    replace t with (release s k n + (t - release s k n)) by lia.
    apply Nat.le_trans with (1 := job_cores_in_run _ k n).
    apply (busy_at_most_width _ m _ L _ w f C).
Qed.

Lemma kept_one_of_part t n N g i :
  t < now -> disjoint_parts (graph (tau k)) N g -> i < N ->
  part_cores (fun v => (g v =? i) && on_core tau k v) t n <= 1.
Proof.
  intros Ht C Hi.
  set (p := fun v => (g v =? i) && on_core tau k v).
  destruct (Nat.eq_dec (part_cores p t n) 0) as [Z|Z]; [lia|].
  assert (H : release s k n <= t < release s k n + R) by (apply (part_support p t n Ht); lia).
  assert (L : legal (graph (tau k)) m (job_run k n)) by (apply kept_legal; lia).
  unfold part_cores. destruct (jobs n); [|lia].
  replace t with (release s k n + (t - release s k n)) by lia.
  apply Nat.le_trans with (2 := one_of_a_part _ m _ L (t - release s k n) N g i C Hi).
  apply sum_le. intros v _. unfold p. simpl.
  destruct (g v =? i), (on_core tau k v), (executes s (release s k n + (t - release s k n)) k n v); simpl; lia.
Qed.

(** At most so many cores execute a part of the DAG, as its jobs do not overlap. *)
Lemma kept_part_width t p c :
  t < now -> (forall n, part_cores p t n <= c) -> forall M, sum M (part_cores p t) <= c.
Proof.
  intros Ht H M.
  apply (one_job_at_a_time M _ (release s k) c R (period (tau k)) t); auto.
  - apply (periods_positive _ _ _ _ _ rules k in_K).
  - intros n. apply (sporadic _ _ _ _ _ rules k n in_K).
  - intros n. apply part_support. auto.
Qed.

(** The workload bounds what a part of the DAG executes in any window before [now], on at most c cores. *)
Lemma kept_part_workload p c r : is_whole p ->
  a + r <= now ->
  sum r (fun t => sum (a + r) (fun n => Nat.min (part_cores p (a + t) n) c))
  <= window_work cut (weight (graph (tau k)) (together (tau k)) p) c R (period (tau k)) r.
Proof.
  intros Whole Hnow.
  set (u n t := if t <? now then Nat.min (part_cores p t n) c else 0).
  apply Nat.le_trans with (sum r (fun t => sum (a + r) (fun n => u n (a + t)))).
  { apply sum_le. intros t Ht. apply sum_le. intros n _. unfold u.
    destruct (Nat.ltb_spec (a + t) now); lia. }
  assert (HT : 0 < period (tau k)) by apply (periods_positive _ _ _ _ _ rules k in_K).
  assert (Hrel : forall n, release s k n + period (tau k) <= release s k (S n))
    by (intros n; apply (sporadic _ _ _ _ _ rules k n in_K)).
  assert (Hc : forall n t, u n t <= c) by (intros n t; unfold u; destruct (t <? now); lia).
  assert (Hs : forall n t, 0 < u n t -> release s k n <= t < release s k n + R).
  { intros n t H. unfold u in H. destruct (Nat.ltb_spec t now); [|lia].
    apply (part_support p); auto. lia. }
  assert (HV : forall n l, sum l (u n) <= weight (graph (tau k)) (together (tau k)) p).
  { intros n l. apply Nat.le_trans with (sum l (fun t => part_cores p t n)).
    - apply sum_le. intros t _. unfold u. destruct (t <? now); lia.
    - apply work_of_part, Whole. }
  assert (W1 := workload_bound (a + r) u (release s k) _ c R _ a r HT in_time Hrel Hc Hs HV).
  unfold window_work. destruct cut as [(Dk, D)|]; auto.
  apply Nat.min_glb; auto.
  apply (workload_by_deadline_bound (a + r) u (release s k)); auto.
  intros n t H. apply due. unfold u, part_cores in H.
  destruct (jobs n); auto. destruct (t <? now); simpl in H; lia.
Qed.

(** *What the DAG's jobs execute in a window, and in any part of it.*  [g] divides them into N chains and a
    rest. *)
Lemma kept_workload q w r :
  a + r <= now -> enough_cores w ->
  sum r (fun t => Nat.min (cores_of_jobs tau s jobs (a + t) k) q)
  <= window_work cut (weight (graph (tau k)) (together (tau k)) (on_core tau k)) (Nat.min q w) R
       (period (tau k)) r.
Proof.
  intros Hnow C.
  apply Nat.le_trans with (2 := kept_part_workload (on_core tau k) (Nat.min q w) r
    ltac:(intros v Hv; rewrite heads_execute; auto) Hnow).
  apply sum_le. intros t Ht. unfold cores_of_jobs.
  apply Nat.le_trans with (1 := min_sum _ _ _).
  apply Nat.le_trans
    with (sum (a + r) (fun n => Nat.min (if jobs n then job_cores tau s (a + t) k n else 0) q)).
  - apply sum_more. lia.
  - apply sum_le. intros n _. rewrite <- all_cores.
    pose proof (kept_width (a + t) n w ltac:(lia) C). destruct (jobs n); lia.
Qed.

Lemma kept_clipped q w N g r (W : nat -> bool) :
  a + r <= now -> enough_cores w -> disjoint_parts (graph (tau k)) N g ->
  (forall v, v < size (graph (tau k)) -> g (head (tau k) v) = g v) ->
  let work p c := window_work cut
    (weight (graph (tau k)) (together (tau k)) (fun v => p v && on_core tau k v)) c R (period (tau k)) r in
  sum r (fun t => if W t then Nat.min (cores_of_jobs tau s jobs (a + t) k) q else 0)
  <= clipped (work (fun _ => true) (Nat.min q w)) (Nat.min q w)
       N (fun i => work (fun v => g v =? i) 1) (work (fun v => N <=? g v) (Nat.min q w)) (count r W).
Proof.
  intros Hnow C D Same work.
  assert (Whole : forall of : nat -> bool, is_whole (fun v => of (g v) && on_core tau k v))
    by (intros of v Hv; rewrite Same, heads_execute; auto).
  set (p := Nat.min q w).
  apply (clipped_is_bound r _ p N _ _ (fun t => Nat.min (cores_of_jobs tau s jobs (a + t) k) q)
    (fun t => sum (a + r) (fun n => Nat.min (part_cores (fun v => (N <=? g v) && on_core tau k v) (a + t) n) p))
    (fun i t => sum (a + r) (fun n => Nat.min (part_cores (fun v => (g v =? i) && on_core tau k v) (a + t) n) 1))).
  - apply (kept_workload q w r Hnow C).
  - intros t Ht. cbv beta.
    assert (cores_of_jobs tau s jobs (a + t) k <= w).
    { apply (kept_part_width (a + t) (on_core tau k)); [lia|].
      intros n. rewrite <- all_cores. pose proof (kept_width (a + t) n w ltac:(lia) C).
      destruct (jobs n); lia. }
    unfold p. lia.
  - intros t Ht. cbv beta. rewrite <- (sum_swap (a + r) N), <- sum_plus.
    apply Nat.le_trans
      with (sum (a + r) (fun n => Nat.min (if jobs n then job_cores tau s (a + t) k n else 0) q)).
    + apply Nat.le_trans with (2 := min_sum _ _ _).
      assert (cores_of_jobs tau s jobs (a + t) k
              <= sum (a + r) (fun n => if jobs n then job_cores tau s (a + t) k n else 0))
        by (apply sum_more; lia).
      lia.
    + apply sum_le. intros n _.
      assert (Split : (if jobs n then job_cores tau s (a + t) k n else 0)
        = sum N (fun i => part_cores (fun v => (g v =? i) && on_core tau k v) (a + t) n)
          + part_cores (fun v => (N <=? g v) && on_core tau k v) (a + t) n).
      { unfold part_cores. destruct (jobs n); [|rewrite sum_zero; auto].
        pose proof (by_chains (graph (tau k))
          (Build_run (fun _ => 0) (fun _ v => on_core tau k v && executes s (a + t) k n v) (fun _ => 0)) 0 g N)
          as B.
        simpl in B.
        rewrite (sum_ext N _ (fun z => count (size (graph (tau k)))
          (fun v => (g v =? z) && (on_core tau k v && executes s (a + t) k n v))))
          by (intros z _; apply sum_ext; intros v _; rewrite andb_assoc; reflexivity).
        rewrite <- B.
        unfold job_cores, count. rewrite <- sum_plus. apply sum_ext. intros v _.
        destruct (on_core tau k v), (executes s (a + t) k n v), (Nat.ltb_spec (g v) N), (Nat.leb_spec N (g v));
          simpl; lia. }
      assert (Ones : sum N (fun i => Nat.min (part_cores (fun v => (g v =? i) && on_core tau k v) (a + t) n) 1)
                     = sum N (fun i => part_cores (fun v => (g v =? i) && on_core tau k v) (a + t) n)).
      { apply sum_ext. intros i Hi. pose proof (kept_one_of_part (a + t) n N g i ltac:(lia) D Hi). lia. }
      pose proof (kept_width (a + t) n w ltac:(lia) C). unfold p. destruct (jobs n); lia.
  - intros i t Hi Ht. cbv beta.
    apply Nat.le_trans with (sum (a + r) (part_cores (fun v => (g v =? i) && on_core tau k v) (a + t))).
    + apply sum_le. intros n _. lia.
    + apply kept_part_width; [lia|]. intros n. apply (kept_one_of_part (a + t) n N g i); auto. lia.
  - intros i Hi. apply kept_part_workload; auto. apply (Whole (fun h => h =? i)).
  - intros t Ht. cbv beta.
    apply (one_job_at_a_time _ _ (release s k) p R (period (tau k)) (a + t)); auto.
    + apply (periods_positive _ _ _ _ _ rules k in_K).
    + intros n. apply (sporadic _ _ _ _ _ rules k n in_K).
    + intros n. lia.
    + intros n H. apply (part_support (fun v => (N <=? g v) && on_core tau k v)); lia.
  - apply kept_part_workload; auto.
Qed.

End kept.
End one_job.

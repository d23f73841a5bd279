(** * The model: a DAG, one job of it, and the schedules that the rules allow

    Time is counted in ticks [0, 1, 2, ...].  One job is released at the start of tick 0.  How long a
    tick is does not matter; README.md says what is and what is not lost by ticks.

    What the model leaves out: overheads (the platform charges them to WCETs), late releases, subtasks
    that share anything but edges, other jobs of the same DAG in flight, pinned subtasks.  Waits for devices
    come in in TaskSet.v: as vertices that are busy on no core. *)

Require Import Arith Lia Bool List.
From Bounds Require Import Sums.

(** ** The graph

    The vertices (subtasks) are [0 .. size - 1], numbered such that edges lead upwards.  Every graph
    without a cycle has such a numbering; it has nothing to do with the order of execution. *)

Record dag := {
  size : nat;
  edge : nat -> nat -> bool;
  edges_lead_up : forall u v, edge u v = true -> u < v < size
}.

(** [precedes G u v]: a path of at least one edge leads from u to v. *)
Inductive precedes (G : dag) (u : nat) : nat -> Prop :=
  | precedes_edge v : edge G u v = true -> precedes G u v
  | precedes_further v w : precedes G u v -> edge G v w = true -> precedes G u w.

(** The same, computed: by paths of at most [n] edges. *)
Fixpoint precedes_within (G : dag) (n u v : nat) : bool :=
  match n with
  | 0 => false
  | S n => if edge G u v then true
           else existsb (fun w => if edge G w v then precedes_within G n u w else false) (seq 0 (size G))
  end.

Definition precedes_bool (G : dag) (u v : nat) : bool := precedes_within G (size G) u v.

(** A path is a list of vertices, *from its last to its first*, each with an edge to the one before it
    in the list. *)
Fixpoint path (G : dag) (l : list nat) : Prop :=
  match l with
  | nil => True
  | v :: rest =>
      v < size G /\
      match rest with nil => True | u :: _ => edge G u v = true end /\
      path G rest
  end.

Definition path_length (c : nat -> nat) (l : list nat) : nat := list_sum (map c l).

(** No path is longer than [len], where vertex v has the length [c v].  The least such [len] is the
    length of the DAG. *)
Definition no_path_longer (G : dag) (c : nat -> nat) (len : nat) : Prop :=
  forall l, path G l -> path_length c l <= len.

Definition volume (G : dag) (c : nat -> nat) : nat := sum (size G) c.

(** ** Disjoint chains

    A family of j + 1 disjoint chains is a label for each vertex: v is in chain [f v] if [f v <= j],
    else in none.  Any two vertices of a chain must be ordered. *)

Definition disjoint_chains (G : dag) (j : nat) (f : nat -> nat) : Prop :=
  forall u v, u < v -> v < size G -> f u = f v -> f v <= j -> precedes G u v.

(** [n] chains that hold all vertices: the graph is at most n wide. *)
Definition chain_cover (G : dag) (n : nat) (f : nat -> nat) : Prop :=
  (forall v, v < size G -> f v < n) /\
  (forall u v, u < v -> v < size G -> f u = f v -> precedes G u v).

(** [n] disjoint chains, [g v < n], and a rest, [g v >= n]. *)
Definition disjoint_parts (G : dag) (n : nat) (g : nat -> nat) : Prop :=
  forall u v, u < v -> v < size G -> g u = g v -> g v < n -> precedes G u v.

(** The work that is in none of the chains: volume less the sum of j + 1 disjoint chains. *)
Definition left_over (G : dag) (x : nat -> nat) (j : nat) (f : nat -> nat) : nat :=
  sum (size G) (fun v => if f v <=? j then 0 else x v).

(** ** A run

    [exec v]: how many ticks v executes in this run.  [runs t v]: whether it executes in tick t.
    [others t]: how many cores execute anything else in tick t (other DAGs, whatever their priority). *)

Record run := {
  exec : nat -> nat;
  runs : nat -> nat -> bool;
  others : nat -> nat
}.

(** Ticks that v has executed before tick t.  A vertex of no execution (a wait whose answer is there at once) is
    finished from the start, so readiness asks for *all* that precedes, not for predecessors alone. *)
Definition done (s : run) (t v : nat) : nat := count t (fun i => runs s i v).

Definition finished (s : run) (t v : nat) : Prop := exec s v <= done s t v.

Definition ready (G : dag) (s : run) (t v : nat) : Prop :=
  v < size G /\ ~ finished s t v /\ forall u, precedes G u v -> finished s t u.

(** The number of cores that execute the job in tick t, one for each vertex that executes. *)
Definition busy (G : dag) (s : run) (t : nat) : nat := count (size G) (runs s t).

(** The job is complete at t (at the end of tick t - 1, if t > 0). *)
Definition complete (G : dag) (s : run) (t : nat) : Prop :=
  forall v, v < size G -> finished s t v.

(** ** The rules

    Only ready subtasks execute, each on one core at a time; and *the scheduler conserves work*: while a ready
    subtask of the job does not execute, all m cores execute something.  (That no more than m do is not needed.)
    Nothing is said of priorities, or of preemption: the order in which ready subtasks are taken may
    be any, and may change from tick to tick. *)

Record legal (G : dag) (m : nat) (s : run) : Prop := {
  only_ready_run : forall t v, v < size G -> runs s t v = true -> ready G s t v;
  work_conserving : forall t v, ready G s t v -> runs s t v = false -> m <= busy G s t + others s t
}.

(** Each vertex executes for its WCET [c v] at most.  It may execute for less: the bounds hold for all
    these runs, although a run with shorter executions can take longer (Graham's anomalies). *)
Definition within_wcet (G : dag) (s : run) (c : nat -> nat) : Prop :=
  forall v, v < size G -> exec s v <= c v.

Definition alone (s : run) : Prop := forall t, others s t = 0.

(** ** First consequences *)

Lemma precedes_up G u v : precedes G u v -> u < v < size G.
Proof.
  induction 1 as [v H|v w H IH E].
  - apply edges_lead_up in H. auto.
  - apply edges_lead_up in E. lia.
Qed.

Lemma precedes_trans G u v w : precedes G u v -> precedes G v w -> precedes G u w.
Proof.
  intros H1 H2. induction H2 as [w E|w x H IH E].
  - apply precedes_further with v; auto.
  - apply precedes_further with w; auto.
Qed.

Lemma done_next s t v : done s (S t) v = done s t v + Nat.b2n (runs s t v).
Proof. reflexivity. Qed.

Lemma done_monotone s t t' v : t <= t' -> done s t v <= done s t' v.
Proof. induction 1; auto. rewrite done_next. lia. Qed.

Lemma finished_later s t t' v : t <= t' -> finished s t v -> finished s t' v.
Proof. unfold finished. intros H F. pose proof (done_monotone s t t' v H). lia. Qed.

Lemma complete_later G s t t' : t <= t' -> complete G s t -> complete G s t'.
Proof. intros H C v Hv. apply finished_later with t; auto. Qed.

Lemma precedes_within_sound G n u v : precedes_within G n u v = true -> precedes G u v.
Proof.
  revert v. induction n; intros v H; [discriminate|]. simpl in H. apply orb_true_iff in H. destruct H as [E|H].
  - apply precedes_edge, E.
  - apply existsb_exists in H. destruct H as (w & _ & H). apply andb_true_iff in H. destruct H as (E & H).
    apply precedes_further with w; auto.
Qed.

Lemma precedes_within_complete G u v : precedes G u v -> forall n, v <= n -> precedes_within G n u v = true.
Proof.
  induction 1 as [v E|v w H IH E]; intros n Hn; pose proof (edges_lead_up _ _ _ E);
    (destruct n; [lia|]); simpl; apply orb_true_iff; [left; exact E|right].
  apply existsb_exists. exists v. rewrite in_seq, E, IH by lia. split; [lia|reflexivity].
Qed.

Lemma precedes_bool_true G u v : precedes_bool G u v = true <-> precedes G u v.
Proof.
  split; [apply precedes_within_sound|]. intros H. apply precedes_within_complete; auto.
  apply precedes_up in H. lia.
Qed.

(** What precedes a vertex, if anything does, has a last edge into it. *)
Lemma last_edge G u v : precedes G u v -> exists w, edge G w v = true.
Proof. destruct 1; eauto. Qed.

Definition finished_bool (s : run) (t v : nat) : bool := exec s v <=? done s t v.

Lemma finished_bool_true s t v : finished_bool s t v = true <-> finished s t v.
Proof. apply Nat.leb_le. Qed.

Lemma finished_bool_false s t v : finished_bool s t v = false <-> ~ finished s t v.
Proof. unfold finished_bool, finished. rewrite Nat.leb_gt. lia. Qed.

Lemma complete_or_not G s t :
  complete G s t \/ exists v, v < size G /\ ~ finished s t v.
Proof.
  destruct (some_or_none (size G) (fun v => negb (finished_bool s t v))) as [(v & Hv & E)|N].
  - right. exists v. split; auto. apply finished_bool_false. apply negb_true_iff, E.
  - left. intros v Hv. apply finished_bool_true. specialize (N v Hv). apply negb_false_iff, N.
Qed.

Definition ready_bool (G : dag) (s : run) (t v : nat) : bool :=
  (v <? size G) && negb (finished_bool s t v)
  && forallb (fun u => negb (precedes_bool G u v) || finished_bool s t u) (seq 0 (size G)).

Lemma ready_bool_true G s t v : ready_bool G s t v = true <-> ready G s t v.
Proof.
  unfold ready_bool, ready. rewrite !andb_true_iff, Nat.ltb_lt, negb_true_iff, finished_bool_false,
    forallb_forall. split.
  - intros ((H1 & H2) & H3). split; [auto|]. split; [auto|]. intros u E.
    pose proof (precedes_up _ _ _ E). apply precedes_bool_true in E. specialize (H3 u).
    rewrite in_seq, E in H3. simpl in H3. apply finished_bool_true, H3. lia.
  - intros (H1 & H2 & H3). split; [auto|]. intros u _. destruct (precedes_bool G u v) eqn:E; auto.
    apply orb_true_iff. right. apply finished_bool_true, H3, precedes_bool_true, E.
Qed.

(** Some ready vertex of the job does not execute. *)
Definition somebody_waits (G : dag) (s : run) (t : nat) : bool :=
  existsb (fun v => ready_bool G s t v && negb (runs s t v)) (seq 0 (size G)).

Lemma somebody_waits_true G s t :
  somebody_waits G s t = true <-> exists v, ready G s t v /\ runs s t v = false.
Proof.
  unfold somebody_waits. rewrite existsb_exists. split.
  - intros (v & _ & H). apply andb_true_iff in H. rewrite ready_bool_true, negb_true_iff in H. eauto.
  - intros (v & Rd & E). exists v. rewrite in_seq, andb_true_iff, ready_bool_true, negb_true_iff.
    pose proof Rd as (Hv & _). split; [lia|auto].
Qed.

Section legal_runs.
Variables (G : dag) (m : nat) (s : run).
Hypothesis rules : legal G m s.

Lemma ready_after_ancestors t u v : precedes G u v -> ready G s t v -> finished s t u.
Proof. intros H (_ & _ & P). apply P, H. Qed.

(** Two ready vertices are never ordered. *)
Lemma ready_not_ordered t u v : ready G s t u -> ready G s t v -> ~ precedes G u v.
Proof. intros (_ & N & _) Rv H. apply N. apply ready_after_ancestors with v; auto. Qed.

(** A vertex never executes for longer than its execution. *)
Lemma done_at_most_exec t v : v < size G -> done s t v <= exec s v.
Proof.
  intros Hv. induction t.
  - unfold done, count. simpl. lia.
  - rewrite done_next. destruct (runs s t v) eqn:E; simpl; [|lia].
    apply (only_ready_run G m s rules) in E; auto. destruct E as (_ & N & _).
    unfold finished in N. lia.
Qed.

(** The work that v has left at the start of tick t. *)
Definition remaining (t v : nat) : nat := exec s v - done s t v.

Lemma remaining_next t v :
  v < size G -> remaining t v = remaining (S t) v + Nat.b2n (runs s t v).
Proof.
  intros Hv. unfold remaining. pose proof (done_at_most_exec (S t) v Hv) as H.
  rewrite done_next in *. lia.
Qed.

Lemma remaining_positive t v : ~ finished s t v -> 0 < remaining t v.
Proof. unfold finished, remaining. lia. Qed.

Lemma remaining_start v : remaining 0 v = exec s v.
Proof. unfold remaining, done, count. simpl. lia. Qed.

End legal_runs.

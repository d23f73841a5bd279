(** * One core: runs in the order of keys, and the stretch before a response

    On one core the scheduler executes the ready instance with the least key, but for one that keeps the core.  The
    key is (absolute deadline, DAG, job, subtask) under EDF and (priority, DAG, job, subtask) under static priorities.
    [full_stretch]: let some instances count, such that what goes before one that counts does, too.  Take the longest
    stretch in which some of these are pending.  In each tick of the stretch that is not lost the core executes one
    that counts, or the one subtask that keeps the core and began before the stretch.

    Jobs of one DAG may overlap, and a deadline may exceed the period. *)

Require Import Arith Lia Bool List.
From Bounds Require Import Sums Model TaskSet.

(** ** The order of keys

    [urgent k v]: the relative deadline of subtask v of DAG k if [edf], else the priority.  [number k v]: by this, ties
    within a job are decided (vertices are numbered along edges, and subtasks need not be). *)

Record keys := { urgent : nat -> nat -> nat; number : nat -> nat -> nat }.
Coercion urgent : keys >-> Funclass.

Definition urgency (edf : bool) (key : keys) (s : set_run) (k n v : nat) : nat :=
  if edf then release s k n + key k v else key k v.

(** The first parts of the key of job n' of DAG h, and a subtask of these, are before those of job n of DAG k. *)
Definition job_before (x h n' y k n : nat) : bool :=
  (x <? y) || (x =? y) && ((h <? k) || (h =? k) && (n' <? n)).

Definition goes_before edf (key : keys) s (h n' w k n v : nat) : bool :=
  let x := urgency edf key s h n' w in
  let y := urgency edf key s k n v in
  job_before x h n' y k n || (x =? y) && (h =? k) && (n' =? n) && (number key h w <? number key k v).

(** Hypothesis by hypothesis, for `in *` takes long. *)
Ltac is_key b := match b with _ || _ => idtac | _ && _ => idtac | _ <? _ => idtac | _ =? _ => idtac end.
Ltac by_keys :=
  repeat match goal with
  | H : ?b = true |- _ =>
      match b with context [goes_before] => idtac | context [job_before] => idtac end;
      unfold goes_before, job_before in H; cbv zeta in H
  | H : context [?b = true] |- _ => is_key b; progress
      repeat first [rewrite orb_true_iff in H | rewrite andb_true_iff in H | rewrite Nat.ltb_lt in H
                    | rewrite Nat.eqb_eq in H]
  end;
  unfold goes_before, job_before; cbv zeta;
  repeat first [rewrite orb_true_iff | rewrite andb_true_iff | rewrite Nat.ltb_lt | rewrite Nat.eqb_eq].

(** Nothing is said by the policy of TaskSet.v: all may delay all, by keys. *)
Definition any_order : policy := {| by_deadline := false; outranks := fun _ _ => true |}.

(** Of a DAG that waits for devices R5 is not asked while an earlier job of it is in flight, as W3 may hold the job
    back. *)
Definition asked (tau : nat -> task) (s : set_run) (t k n : nat) : Prop :=
  (forall v, v < size (graph (tau k)) -> waits (tau k) v = false) \/ earlier_complete tau s t k n.

Record keyed_run (K : nat) (tau : nat -> task) (edf : bool) (key : keys) (s : set_run) : Prop := {
  (** R1 to R4, at most one instance has the core, what has begun keeps the core where it says so. *)
  on_one_core : global_run K 1 tau any_order s;
  all_regular : forall k, k < K -> regular (tau k) = true;
  (** R5: save in lost ticks, while an instance is ready and does not execute, the core executes what goes before, or
      what keeps the core and has begun. *)
  by_key : forall t k n v, k < K -> waits (tau k) v = false -> asked tau s t k n -> lost s t = false ->
    instance_ready tau s t k n v -> executes s t k n v = false ->
    exists h n' w, h < K /\ w < size (graph (tau h)) /\ waits (tau h) w = false /\ executes s t h n' w = true /\
      (goes_before edf key s h n' w k n v = true \/ keeps (tau h) w = true /\ has_begun s t h n' w = true);
  (** R5: what begins goes before all that is ready, in lost ticks, too. *)
  begins_by_key : forall t k n v, k < K -> waits (tau k) v = false -> asked tau s t k n ->
    instance_ready tau s t k n v -> executes s t k n v = false ->
    forall h n' w, h < K -> w < size (graph (tau h)) -> waits (tau h) w = false ->
      has_begun s t h n' w = false -> executes s t h n' w = true -> goes_before edf key s h n' w k n v = true
}.

(** ** More sums *)

Lemma sum_two n f i j : i < n -> j < n -> i <> j -> f i + f j <= sum n f.
Proof.
  induction n; simpl; intros Hi Hj Ne; [lia|].
  destruct (Nat.eq_dec i n) as [->|Ni].
  - pose proof (sum_term n f j). lia.
  - destruct (Nat.eq_dec j n) as [->|Nj]; [pose proof (sum_term n f i); lia|].
    specialize (IHn ltac:(lia) ltac:(lia) Ne). lia.
Qed.

Lemma sum_less n f g i : (forall k, k < n -> f k <= g k) -> i < n -> f i < g i -> sum n f < sum n g.
Proof.
  induction n; simpl; intros H Hi L; [lia|].
  destruct (Nat.eq_dec i n) as [->|Ne].
  - pose proof (sum_le n f g). specialize (H0 ltac:(intros; apply H; lia)). lia.
  - specialize (IHn ltac:(intros; apply H; lia) ltac:(lia) L). specialize (H n ltac:(lia)). lia.
Qed.

Section run.
Variables (K : nat) (tau : nat -> task) (edf : bool) (key : keys) (s : set_run).
Hypothesis rules : keyed_run K tau edf key s.

Let plain := on_one_core _ _ _ _ _ rules.

Lemma executing_is_ready t k n v :
  k < K -> v < size (graph (tau k)) -> executes s t k n v = true -> instance_ready tau s t k n v.
Proof. intros. apply (only_ready_execute _ _ _ _ _ plain); auto. Qed.

Lemma executes_after_release t k n v :
  k < K -> v < size (graph (tau k)) -> executes s t k n v = true -> release s k n <= t.
Proof. intros Hk Hv E. apply executing_is_ready in E; auto. destruct E as (_ & H & _). exact H. Qed.

Lemma executes_unfinished t k n v :
  k < K -> v < size (graph (tau k)) -> executes s t k n v = true -> ~ job_finished s t k n v.
Proof. intros Hk Hv E. apply executing_is_ready in E; auto. destruct E as (_ & _ & H & _). exact H. Qed.

Lemma releases_grow k n n' : k < K -> n < n' -> release s k n + period (tau k) <= release s k n'.
Proof.
  intros Hk H. replace n' with (n + S (n' - n - 1)) by lia.
  pose proof (releases_apart K 1 tau any_order s plain k n (S (n' - n - 1)) Hk). nia.
Qed.

Lemma done_within_execution t k n v :
  k < K -> v < size (graph (tau k)) -> job_done s t k n v <= job_exec s k n v.
Proof.
  intros Hk Hv. induction t.
  - unfold job_done, count. simpl. lia.
  - change (job_done s t k n v + Nat.b2n (executes s t k n v) <= job_exec s k n v).
    destruct (executes s t k n v) eqn:E; simpl; [|lia].
    apply executes_unfinished in E; auto. unfold job_finished in E. lia.
Qed.

Lemma finished_after_ancestors t k n u v :
  k < K -> v < size (graph (tau k)) -> waits (tau k) v = false -> precedes (graph (tau k)) u v ->
  job_finished s t k n v -> job_finished s t k n u.
Proof.
  intros Hk Hv W P F.
  pose proof (proj1 (executions _ _ _ _ _ plain k n v Hk Hv) W (all_regular _ _ _ _ _ rules k Hk)).
  assert (Pos : 0 < job_done s t k n v) by (unfold job_finished in F; lia).
  apply sum_positive in Pos. destruct Pos as (i & Hi & E).
  destruct (executes s i k n v) eqn:Ei; [|simpl in E; lia].
  apply executing_is_ready in Ei; auto. destruct Ei as (_ & _ & _ & An & _).
  apply job_finished_later with i; [lia|]. apply An, P.
Qed.

Lemma done_grows t t' k n v : t <= t' -> job_done s t k n v <= job_done s t' k n v.
Proof. intros H. apply sum_more. exact H. Qed.

Lemma done_since b x k n v :
  job_done s (b + x) k n v = job_done s b k n v + count x (fun t => executes s (b + t) k n v).
Proof. apply (sum_shift b x (fun i => Nat.b2n (executes s i k n v))). Qed.

(** *** One at a time *)

Lemma begun_is_released t k n v :
  k < K -> v < size (graph (tau k)) -> has_begun s t k n v = true -> release s k n < t.
Proof.
  intros Hk Hv B. unfold has_begun in B. apply Nat.ltb_lt, sum_positive in B. destruct B as (i & Hi & E).
  destruct (executes s i k n v) eqn:Ei; simpl in E; [|lia].
  apply executes_after_release in Ei; auto. lia.
Qed.

Lemma holds_is_released t k n v :
  k < K -> v < size (graph (tau k)) -> holds_core tau s t k n v = true -> release s k n <= t.
Proof.
  intros Hk Hv H. unfold holds_core in H. rewrite orb_true_iff, !andb_true_iff in H.
  destruct H as [E|((_ & B) & _)].
  - apply (executes_after_release t k n v); auto.
  - apply begun_is_released in B; auto. lia.
Qed.

Definition on_the_core (t k n v : nat) : Prop :=
  k < K /\ v < size (graph (tau k)) /\ waits (tau k) v = false /\ holds_core tau s t k n v = true.

Lemma one_at_a_time t k n v h n' w :
  on_the_core t k n v -> on_the_core t h n' w -> k = h /\ n = n' /\ v = w.
Proof.
  intros (Hk & Hv & Wv & E) (Hh & Hw & Ww & E').
  pose proof (cores _ _ _ _ _ plain t) as C.
  pose proof (holds_is_released t k n v Hk Hv E) as R. pose proof (release_at_least K 1 tau any_order s plain k n Hk).
  pose proof (holds_is_released t h n' w Hh Hw E') as R'.
  pose proof (release_at_least K 1 tau any_order s plain h n' Hh).
  assert (B : forall k n v, v < size (graph (tau k)) -> waits (tau k) v = false -> holds_core tau s t k n v = true ->
    1 <= count (size (graph (tau k))) (fun v => on_core tau k v && holds_core tau s t k n v)).
  { intros a c d Hd Wd Ed.
    apply Nat.le_trans with (2 := sum_term _ (fun v => Nat.b2n (on_core tau a v && holds_core tau s t a c v)) d Hd).
    unfold on_core. rewrite Wd, Ed. simpl. lia. }
  assert (T : forall k n v, n <= t -> v < size (graph (tau k)) -> waits (tau k) v = false ->
    holds_core tau s t k n v = true -> 1 <= cores_held tau s t k).
  { intros a c d Hc Hd Wd Ed. unfold cores_held.
    apply Nat.le_trans with (1 := B a c d Hd Wd Ed).
    apply (sum_term (S t)
      (fun n => count (size (graph (tau a))) (fun v => on_core tau a v && holds_core tau s t a n v))).
    lia. }
  destruct (Nat.eq_dec k h) as [->|Nk].
  2:{ pose proof (sum_two K (cores_held tau s t) k h Hk Hh Nk).
      pose proof (T k n v ltac:(lia) Hv Wv E). pose proof (T h n' w ltac:(lia) Hw Ww E'). lia. }
  split; auto.
  pose proof (sum_term K (cores_held tau s t) h Hh) as Th.
  destruct (Nat.eq_dec n n') as [->|Nn].
  2:{ unfold cores_held in Th.
      pose proof (sum_two (S t)
        (fun n => count (size (graph (tau h))) (fun v => on_core tau h v && holds_core tau s t h n v))
        n n' ltac:(lia) ltac:(lia) Nn) as U. cbv beta in U.
      pose proof (B h n v Hv Wv E). pose proof (B h n' w Hw Ww E'). unfold cores_held in C. lia. }
  split; auto.
  destruct (Nat.eq_dec v w) as [->|Nv]; auto. exfalso.
  assert (Two : 2 <= count (size (graph (tau h))) (fun v => on_core tau h v && holds_core tau s t h n' v)).
  { apply Nat.le_trans with (2 := sum_two (size (graph (tau h)))
      (fun v => Nat.b2n (on_core tau h v && holds_core tau s t h n' v)) v w Hv Hw Nv).
    unfold on_core. rewrite Wv, Ww, E, E'. simpl. lia. }
  assert (Job : count (size (graph (tau h))) (fun v => on_core tau h v && holds_core tau s t h n' v)
    <= cores_held tau s t h).
  { apply (sum_term (S t)
      (fun n => count (size (graph (tau h))) (fun v => on_core tau h v && holds_core tau s t h n v)) n' ltac:(lia)). }
  lia.
Qed.

Lemma executing_on_the_core t k n v :
  k < K -> v < size (graph (tau k)) -> waits (tau k) v = false -> executes s t k n v = true ->
  on_the_core t k n v.
Proof. intros. split; [auto|]. split; [auto|]. split; [auto|]. unfold holds_core. rewrite H2. reflexivity. Qed.

(** ** What counts, and the stretch in which some of it is pending *)

Variable counts : nat -> nat -> nat -> bool.
Hypothesis closed_by_edges : forall h n u w,
  h < K -> counts h n w = true -> edge (graph (tau h)) u w = true -> counts h n u = true.
Hypothesis closed_by_jobs : forall h n' n w,
  h < K -> w < size (graph (tau h)) -> n' < n -> counts h n w = true -> counts h n' w = true.
Hypothesis closed_by_keys : forall t k n v h n' w, k < K -> h < K -> counts k n v = true ->
  instance_ready tau s t k n v -> instance_ready tau s t h n' w ->
  goes_before edf key s h n' w k n v = true -> counts h n' w = true.
Hypothesis waitless : forall h n w, h < K -> w < size (graph (tau h)) -> counts h n w = true ->
  forall v, v < size (graph (tau h)) -> waits (tau h) v = false.
Hypothesis wcets_known : forall h n w,
  h < K -> w < size (graph (tau h)) -> counts h n w = true -> known (tau h) = true.

Lemma never_waits h n w :
  h < K -> w < size (graph (tau h)) -> counts h n w = true -> waits (tau h) w = false.
Proof. intros Hh Hw C. apply (waitless h n w); auto. Qed.

Definition pending (t h n w : nat) : Prop :=
  h < K /\ w < size (graph (tau h)) /\ counts h n w = true /\ ~ job_finished s t h n w.

(** All that counts and was released before b has finished at b. *)
Definition clear (b : nat) : Prop := forall h n w,
  h < K -> w < size (graph (tau h)) -> counts h n w = true -> release s h n < b -> job_finished s b h n w.

Lemma clear_or_pending b : clear b \/ exists h n w, pending b h n w /\ release s h n < b.
Proof.
  set (late h n w := counts h n w && (release s h n <? b) && negb (job_exec s h n w <=? job_done s b h n w)).
  destruct (some_or_none K (fun h => existsb (fun n => existsb (late h n) (seq 0 (size (graph (tau h))))) (seq 0 b)))
    as [(h & Hh & E)|N].
  - right. apply existsb_exists in E. destruct E as (n & _ & E).
    apply existsb_exists in E. destruct E as (w & Hw & E). apply in_seq in Hw. unfold late in E.
    rewrite !andb_true_iff, Nat.ltb_lt, negb_true_iff, Nat.leb_gt in E. destruct E as ((C & R) & F).
    exists h, n, w. split; [|auto]. split; [auto|]. split; [lia|]. split; [auto|]. unfold job_finished. lia.
  - left. intros h n w Hh Hw C R. specialize (N h Hh).
    destruct (le_lt_dec (job_exec s h n w) (job_done s b h n w)) as [F|F]; [exact F|]. exfalso.
    assert (E : existsb (fun n => existsb (late h n) (seq 0 (size (graph (tau h))))) (seq 0 b) = true);
      [|congruence].
    apply existsb_exists. exists n. split.
    { apply in_seq. pose proof (release_at_least K 1 tau any_order s plain h n Hh). lia. }
    apply existsb_exists. exists w. split; [apply in_seq; lia|]. unfold late.
    rewrite C. apply Nat.ltb_lt in R. rewrite R. apply Nat.leb_gt in F. rewrite F. reflexivity.
Qed.

(** The last instant up to t at which nothing is pending of what was released before. *)
Lemma last_clear t : exists b, b <= t /\ clear b /\ forall t', b < t' <= t ->
  exists h n w, pending t' h n w /\ release s h n < t'.
Proof.
  induction t as [|t (b & Hb & C & P)].
  - exists 0. split; [lia|]. split; [|intros; lia]. intros h n w _ _ _ H. lia.
  - destruct (clear_or_pending (S t)) as [C'|P'].
    + exists (S t). split; [lia|]. split; [auto|intros; lia].
    + exists b. split; [lia|]. split; [auto|]. intros t' H.
      destruct (Nat.eq_dec t' (S t)) as [->|]; [exact P'|apply P; lia].
Qed.

Lemma pending_before t t' h n w : t <= t' -> pending t' h n w -> pending t h n w.
Proof.
  intros H (A & B & C & D). split; [auto|]. split; [auto|]. split; [auto|].
  intros F. apply D. apply job_finished_later with t; auto.
Qed.

(** Where some of it is pending, some of it is ready. *)
Lemma some_ready t h : h < K -> forall n w, pending t h n w -> release s h n <= t ->
  exists n' u, counts h n' u = true /\ instance_ready tau s t h n' u.
Proof.
  intros Hh. induction n as [n IHn] using (well_founded_induction lt_wf).
  induction w as [w IHw] using (well_founded_induction lt_wf). intros (_ & Hw & Cw & N) Rel.
  destruct (some_or_none (size (graph (tau h))) (fun u =>
    edge (graph (tau h)) u w && negb (job_exec s h n u <=? job_done s t h n u))) as [(u & Hu & E)|None].
  - apply andb_true_iff in E. destruct E as (E & F). apply negb_true_iff, Nat.leb_gt in F.
    pose proof (edges_lead_up _ _ _ E). apply (IHw u); [lia| |auto].
    split; [auto|]. split; [lia|]. split; [eauto|]. unfold job_finished. lia.
  - assert (Preds : forall u, edge (graph (tau h)) u w = true -> job_finished s t h n u).
    { intros u E. pose proof (edges_lead_up _ _ _ E). specialize (None u ltac:(lia)).
      rewrite E in None. simpl in None. apply negb_false_iff, Nat.leb_le in None. exact None. }
    assert (Ancestors : forall u, precedes (graph (tau h)) u w -> job_finished s t h n u).
    { intros u Pr. inversion Pr as [v E|x v P' E]; subst; [auto|].
      pose proof (edges_lead_up _ _ _ E). pose proof (Preds x E) as F.
      apply (finished_after_ancestors t h n u x); auto; [lia|].
      apply (never_waits h n x); auto; [lia|]. apply (closed_by_edges h n x w); auto. }
    destruct (some_or_none n (fun n' => negb (job_exec s h n' w <=? job_done s t h n' w))) as [(n' & Hn & E)|F].
    + apply negb_true_iff, Nat.leb_gt in E. pose proof (releases_grow h n' n Hh Hn).
      apply (IHn n' Hn w); [|lia]. split; [auto|]. split; [auto|].
      split; [apply (closed_by_jobs h n' n); auto|]. unfold job_finished. lia.
    + exists n, w. split; [auto|]. split; [auto|]. split; [auto|]. split; [auto|]. split; [auto|].
      intros n' Hn. specialize (F n' Hn). apply negb_false_iff, Nat.leb_le in F. exact F.
Qed.

(** Of what does not count, this alone executes in a stretch that begins at b: it keeps the core, and began before. *)
Definition blocker (b h n w : nat) : Prop :=
  h < K /\ w < size (graph (tau h)) /\ waits (tau h) w = false /\ keeps (tau h) w = true /\
  counts h n w = false /\ has_begun s b h n w = true /\ ~ job_finished s b h n w.

Lemma begins_at_some_tick k n v b d :
  has_begun s b k n v = false -> has_begun s (b + d) k n v = true ->
  exists t, b <= t < b + d /\ has_begun s t k n v = false /\ executes s t k n v = true.
Proof.
  intros No. induction d; intros Yes; [rewrite Nat.add_0_r in Yes; congruence|].
  destruct (has_begun s (b + d) k n v) eqn:E.
  - destruct (IHd eq_refl) as (t & Ht & H). exists t. split; [lia|exact H].
  - exists (b + d). split; [lia|]. split; [auto|].
    unfold has_begun in *. apply Nat.ltb_lt in Yes. apply Nat.ltb_ge in E.
    replace (b + S d) with (S (b + d)) in Yes by lia.
    change (0 < job_done s (b + d) k n v + Nat.b2n (executes s (b + d) k n v)) in Yes.
    destruct (executes s (b + d) k n v); auto. simpl in Yes. lia.
Qed.

Definition stretch (b e : nat) : Prop :=
  forall t, b <= t < e -> exists h n w, pending t h n w /\ release s h n <= t.

Lemma tick_of_stretch b e t :
  stretch b e -> b <= t < e -> lost s t = false ->
  exists h n w, on_the_core t h n w /\ executes s t h n w = true /\ (counts h n w = true \/ blocker b h n w).
Proof.
  intros Str Ht Lo.
  destruct (Str t Ht) as (h0 & n0 & w0 & P & R0). pose proof P as (Hh0 & _).
  destruct (some_ready t h0 Hh0 n0 w0 P R0) as (n & v & Cv & Rd). pose proof Rd as (Hv & _).
  destruct (executes s t h0 n v) eqn:E.
  { exists h0, n, v. split; [|auto]. apply executing_on_the_core; auto. apply (never_waits h0 n); auto. }
  destruct (by_key _ _ _ _ _ rules t h0 n v Hh0 (never_waits h0 n v Hh0 Hv Cv)
    (or_introl (waitless h0 n v Hh0 Hv Cv)) Lo Rd E)
    as (h & n' & w & Hh & Hw & Ww & Ew & O).
  exists h, n', w. split; [apply executing_on_the_core; auto|]. split; [auto|].
  destruct (counts h n' w) eqn:C; [auto|right].
  destruct O as [O|(Kp & Bg)].
  { rewrite (closed_by_keys t h0 n v h n' w) in C; auto; [discriminate|]. apply executing_is_ready; auto. }
  split; [auto|]. split; [auto|]. split; [auto|]. split; [auto|]. split; [auto|].
  split; [|intros F; apply (executes_unfinished t h n' w Hh Hw Ew), job_finished_later with b; auto; lia].
  destruct (has_begun s b h n' w) eqn:B; [auto|exfalso].
  destruct (begins_at_some_tick h n' w b (t - b) B) as (i & Hi & Bi & Ei).
  { replace (b + (t - b)) with t by lia. exact Bg. }
  destruct (Str i ltac:(lia)) as (h1 & n1 & w1 & P1 & R1). pose proof P1 as (Hh1 & _).
  destruct (some_ready i h1 Hh1 n1 w1 P1 R1) as (n2 & v2 & C2 & Rd2). pose proof Rd2 as (Hv2 & _).
  destruct (executes s i h1 n2 v2) eqn:E2.
  - destruct (one_at_a_time i h1 n2 v2 h n' w) as (-> & -> & ->); [| |congruence];
      apply executing_on_the_core; auto. apply (never_waits h1 n2); auto.
  - pose proof (begins_by_key _ _ _ _ _ rules i h1 n2 v2 Hh1 (never_waits h1 n2 v2 Hh1 Hv2 C2)
      (or_introl (waitless h1 n2 v2 Hh1 Hv2 C2)) Rd2 E2
      h n' w Hh Hw Ww Bi Ei) as O.
    rewrite (closed_by_keys i h1 n2 v2 h n' w) in C; auto; [discriminate|]. apply executing_is_ready; auto.
Qed.

Lemma one_blocker b h n w h' n' w' :
  blocker b h n w -> blocker b h' n' w' -> h = h' /\ n = n' /\ w = w'.
Proof.
  intros A B. apply (one_at_a_time b).
  - destruct A as (A1 & A2 & A3 & A4 & _ & A6 & A7). split; [auto|]. split; [auto|]. split; [auto|].
    unfold holds_core. rewrite A4, A6. simpl. apply orb_true_iff. right. apply Nat.ltb_lt.
    unfold job_finished in A7. lia.
  - destruct B as (A1 & A2 & A3 & A4 & _ & A6 & A7). split; [auto|]. split; [auto|]. split; [auto|].
    unfold holds_core. rewrite A4, A6. simpl. apply orb_true_iff. right. apply Nat.ltb_lt.
    unfold job_finished in A7. lia.
Qed.

(** ** The work in a stretch *)

Definition instance_work (b x h n v : nat) : nat :=
  count x (fun t => counts h n v && executes s (b + t) h n v).

Definition counted_work (b x : nat) : nat :=
  sum K (fun h => sum (b + x) (fun n => sum (size (graph (tau h))) (instance_work b x h n))).

Lemma instance_work_done b x h n v :
  instance_work b x h n v + job_done s b h n v <= job_done s (b + x) h n v.
Proof.
  rewrite done_since. unfold instance_work.
  assert (count x (fun t => counts h n v && executes s (b + t) h n v)
          <= count x (fun t => executes s (b + t) h n v)); [|lia].
  apply sum_le. intros t _. destruct (counts h n v), (executes s (b + t) h n v); simpl; lia.
Qed.

Lemma not_counted b x h n v : counts h n v = false -> instance_work b x h n v = 0.
Proof. intros C. apply sum_zero. intros t _. rewrite C. reflexivity. Qed.

Lemma released_later b x h n v :
  h < K -> v < size (graph (tau h)) -> b + x <= release s h n -> instance_work b x h n v = 0.
Proof.
  intros Hh Hv R. apply sum_zero. intros t Ht.
  rewrite (not_before_release K 1 tau any_order s plain); auto; [|lia]. rewrite andb_false_r. reflexivity.
Qed.

Lemma released_earlier b x h n v :
  h < K -> v < size (graph (tau h)) -> clear b -> release s h n < b -> instance_work b x h n v = 0.
Proof.
  intros Hh Hv C R. apply sum_zero. intros t Ht.
  destruct (counts h n v) eqn:Ct; auto. destruct (executes s (b + t) h n v) eqn:E; auto. exfalso.
  apply (executes_unfinished (b + t) h n v Hh Hv E). apply job_finished_later with b; [lia|]. apply C; auto.
Qed.

Lemma work_within_wcet b x h n v :
  h < K -> v < size (graph (tau h)) -> instance_work b x h n v <= wcet (tau h) v.
Proof.
  intros Hh Hv. destruct (counts h n v) eqn:C; [|rewrite not_counted; auto; lia].
  pose proof (instance_work_done b x h n v). pose proof (done_within_execution (b + x) h n v Hh Hv).
  pose proof (proj2 (executions _ _ _ _ _ plain h n v Hh Hv) (wcets_known h n v Hh Hv C)). lia.
Qed.

Lemma unfinished_work b x h n v :
  h < K -> v < size (graph (tau h)) -> counts h n v = true ->
  ~ job_finished s (b + x) h n v -> instance_work b x h n v < wcet (tau h) v.
Proof.
  intros Hh Hv C F. pose proof (instance_work_done b x h n v).
  pose proof (proj2 (executions _ _ _ _ _ plain h n v Hh Hv) (wcets_known h n v Hh Hv C)).
  unfold job_finished in F. lia.
Qed.

(** *The core is never idle in a stretch.*  [others] are the ticks in which a blocking subtask executes. *)
Lemma full_stretch b x others :
  stretch b (b + x) ->
  (forall h n w t, blocker b h n w -> executes s t h n w = true -> others t = true) ->
  x <= count x (fun t => lost s (b + t)) + counted_work b x + count x (fun t => others (b + t)).
Proof.
  intros Str Bl.
  assert (E : counted_work b x = sum x (fun t => sum K (fun h => sum (b + x) (fun n =>
    sum (size (graph (tau h))) (fun v => Nat.b2n (counts h n v && executes s (b + t) h n v)))))).
  { unfold counted_work, instance_work, count. symmetry. rewrite sum_swap. apply sum_ext. intros h _.
    rewrite sum_swap. apply sum_ext. intros n _. apply sum_swap. }
  rewrite E. unfold count. rewrite <- !sum_plus.
  apply Nat.le_trans with (sum x (fun _ => 1)); [rewrite sum_const; lia|].
  apply sum_le. intros t Ht. destruct (lost s (b + t)) eqn:Lo; simpl; [lia|].
  destruct (tick_of_stretch b (b + x) (b + t) Str ltac:(lia) Lo) as (h & n & w & (Hh & Hw & _ & _) & Ex & [C|B]).
  - assert (1 <= sum K (fun h => sum (b + x) (fun n =>
      sum (size (graph (tau h))) (fun v => Nat.b2n (counts h n v && executes s (b + t) h n v))))); [|lia].
    pose proof (executes_after_release (b + t) h n w Hh Hw Ex).
    pose proof (release_at_least K 1 tau any_order s plain h n Hh).
    apply Nat.le_trans with (2 := sum_term K (fun h => sum (b + x) (fun n =>
      sum (size (graph (tau h))) (fun v => Nat.b2n (counts h n v && executes s (b + t) h n v)))) h Hh).
    apply Nat.le_trans with (2 := sum_term (b + x) (fun n =>
      sum (size (graph (tau h))) (fun v => Nat.b2n (counts h n v && executes s (b + t) h n v))) n ltac:(lia)).
    apply Nat.le_trans with (2 := sum_term (size (graph (tau h)))
      (fun v => Nat.b2n (counts h n v && executes s (b + t) h n v)) w Hw).
    rewrite C, Ex. simpl. lia.
  - rewrite (Bl h n w (b + t) B Ex). simpl. lia.
Qed.

Lemma full_without_blocker b x :
  stretch b (b + x) -> (forall h n w, ~ blocker b h n w) ->
  x <= count x (fun t => lost s (b + t)) + counted_work b x.
Proof.
  intros Str No. pose proof (full_stretch b x (fun _ => false) Str) as F.
  assert (Z : count x (fun _ => false) = 0) by (apply sum_zero; auto).
  assert (x <= count x (fun t => lost s (b + t)) + counted_work b x + count x (fun _ => false)); [|lia].
  apply F. intros h n w t B. exfalso. apply (No h n w B).
Qed.

(** What blocks began before, so less than its WCET is left. *)
Lemma full_with_blocker b x h n w :
  stretch b (b + x) -> blocker b h n w -> known (tau h) = true ->
  S x <= count x (fun t => lost s (b + t)) + counted_work b x + wcet (tau h) w.
Proof.
  intros Str B Kn. pose proof (full_stretch b x (fun t => executes s t h n w) Str) as F.
  assert (F' : x <= count x (fun t => lost s (b + t)) + counted_work b x + count x (fun t => executes s (b + t) h n w)).
  { apply F. intros h' n' w' t B' E. destruct (one_blocker b h n w h' n' w' B B') as (-> & -> & ->). exact E. }
  destruct B as (Hh & Hw & _ & _ & _ & Bg & _). unfold has_begun in Bg. apply Nat.ltb_lt in Bg.
  pose proof (done_within_execution (b + x) h n w Hh Hw) as D. rewrite done_since in D.
  pose proof (proj2 (executions _ _ _ _ _ plain h n w Hh Hw) Kn). lia.
Qed.

(** Any bounds of the instances' works bound the sum; and if some instance has less, by more than nothing. *)
Lemma counted_at_most b x (most : nat -> nat -> nat -> nat) :
  (forall h n v, h < K -> v < size (graph (tau h)) -> instance_work b x h n v <= most h n v) ->
  counted_work b x <= sum K (fun h => sum (b + x) (fun n => sum (size (graph (tau h))) (most h n))).
Proof. intros H. apply sum_le. intros h Hh. apply sum_le. intros n _. apply sum_le. intros v Hv. auto. Qed.

Lemma counted_less b x (most : nat -> nat -> nat -> nat) h n v :
  (forall h n v, h < K -> v < size (graph (tau h)) -> instance_work b x h n v <= most h n v) ->
  h < K -> v < size (graph (tau h)) -> n < b + x -> instance_work b x h n v < most h n v ->
  counted_work b x < sum K (fun h => sum (b + x) (fun n => sum (size (graph (tau h))) (most h n))).
Proof.
  intros H Hh Hv Hn L. unfold counted_work.
  apply (sum_less K _ _ h); auto.
  - intros k Hk. apply sum_le. intros i _. apply sum_le. intros u Hu. auto.
  - apply (sum_less (b + x) _ _ n); auto.
    + intros i _. apply sum_le. intros u Hu. auto.
    + apply (sum_less _ _ _ v); auto.
Qed.

End run.

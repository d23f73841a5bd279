(** * The judge of the form [core] for what was committed

    The commit is that of Commit.v, and so are the tasks.  The keys are computed: from the priorities of the subtasks,
      or
    from the deadlines of sinks.  [judge_core] says of which DAGs it has shown all that is claimed: the bound, if
    one is, and those of sinks. *)

Require Import Arith Lia Bool List NArith.
From Bounds Require Import Sums Model TaskSet Checker AnyResolution Commit OneCoreStretch OneCore OneCoreOrder
  OneCoreCheck.
Import ListNotations.

(** What [commit] does not say of a DAG's subtasks, and what shows a bound by the form [core]. *)
Record core_statement := {
  own_dues : list N;        (* by subtask: its own deadline if it is a sink that has one, else 0 *)
  own_numbers : list nat;   (* by subtask: its number, where those of [commit] are in an order along edges *)
  core_bound : option N;    (* the claimed bound, if there is one *)
  core_stretch : N;
  core_level : N;
  core_points : list (N * list N);
  core_sinks : list sink_claim   (* by vertex *)
}.

Definition no_core_statement : core_statement :=
  {| own_dues := []; own_numbers := []; core_bound := None; core_stretch := 0; core_level := 0; core_points := [];
    core_sinks := [] |}.

(** By subtask the least deadline of the sinks that it reaches.  A sink reaches itself. *)
Definition least_dues (d : dag_statement) (own : list N) : list N :=
  fold_right (fun v later =>
    let after := combine (skipn (S v) (subtasks d)) later in
    let reached := filter (fun p => existsb (Nat.eqb v) (predecessors (fst p))) after in
    let start := match nth v own 0%N with 0%N => due d | own_due => own_due end in
    fold_right N.min start (map snd reached) :: later) [] (seq 0 (length (subtasks d))).

(** By vertex the subtask that it is a segment, or a wait, of. *)
Definition subtask_of (d : dag_statement) : list nat :=
  flat_map (fun p => repeat (fst p) (length (times (snd p)))) (combine (seq 0 (length (subtasks d))) (subtasks d)).

Definition with_bound (c : claim) (r : option N) : claim :=
  {| wcets := wcets c; shared := shared c; wait_list := wait_list c; preds := preds c; minimum_period := minimum_period c;
     relative_deadline := relative_deadline c; least_deadline := least_deadline c; outranked_by := outranked_by c;
     keeping := keeping c; known_wcets := known_wcets c;
     claimed := match r with Some _ => true | None => false end;
     bound := match r with Some r => r | None => 0%N end; loss := Checker.loss c; width := width c; cover := cover c;
     parts := parts c; part_of := part_of c; free_chains := free_chains c; chain_of := chain_of c;
     first_level := first_level c; later_level := later_level c;
     costless := costless c |}.

Section commit.
Variables (c : commit) (more : list core_statement) (bursts : list burst).

Definition more_of (k : nat) : core_statement := nth k more no_core_statement.

(** The first part of a key: deadlines under EDF, else priorities. *)
Definition keys_by_vertex (k : nat) : list N :=
  let d := dag_at c k in
  let of_subtasks := if is_edf c then least_dues d (own_dues (more_of k)) else map priority (subtasks d) in
  map (fun v => nth v of_subtasks 0%N) (subtask_of d).

Definition numbers_by_vertex (k : nat) : list nat :=
  map (fun v => nth v (own_numbers (more_of k)) 0) (subtask_of (dag_at c k)).

Definition stated_keys : keys :=
  {| urgent := fun k v => N.to_nat (nth v (keys_by_vertex k) 0%N); number := fun k v => nth v (numbers_by_vertex k) 0
    |}.

Definition core_claim_at (k : nat) : core_claim :=
  let vs := expand (overhead c) (subtasks (dag_at c k)) in
  let ks := keys_by_vertex k in
  let ns := numbers_by_vertex k in
  {| of_dag := with_bound (claim_at c true k) (core_bound (more_of k));
     key_at := fun v => nth v ks 0%N;
     number_at := fun v => nth v ns 0;
     keeps_at := fun v => match nth_error vs v with Some x => keeps_its_core (owner x) | None => false end;
     least_urgent := core_level (more_of k);
     longest_stretch := core_stretch (more_of k);
     points := core_points (more_of k);
     sinks := core_sinks (more_of k) |}.

Definition core_claims : list core_claim := map core_claim_at (seq 0 (Commit.number c)).

Definition judge_core : list bool :=
  let cs := core_claims in
  let fine := (machine_cores c =? 1) && match ranking c with Any => false | _ => true end &&
              forallb subtasks_ok (dags c) in
  map (fun k => if fine && (if claimed (dag_of cs k) then core_claim_ok (is_edf c) bursts cs k
                            else has_some (core_sinks (more_of k)))
                then forallb (fun b => b) (core_sinks_ok (is_edf c) bursts cs k) else false)
    (seq 0 (Commit.number c)).

(** A run of the same tasks by the same keys. *)
Lemma keyed_same K tau tau' edf key key' s :
  (forall k, k < K -> tau k = tau' k) ->
  (forall k v, k < K -> urgent key k v = urgent key' k v /\ OneCoreStretch.number key k v = OneCoreStretch.number key'
    k v) ->
  keyed_run K tau edf key s -> keyed_run K tau' edf key' s.
Proof.
  intros Eq Ek R.
  assert (Rd : forall t k n v, k < K -> instance_ready tau' s t k n v -> instance_ready tau s t k n v)
    by (intros t k n v Hk; unfold instance_ready; rewrite (Eq k Hk); auto).
  assert (Go : forall h n' w k n v, h < K -> k < K ->
    goes_before edf key s h n' w k n v = goes_before edf key' s h n' w k n v).
  { intros h n' w k n v Hh Hk. unfold goes_before, urgency. cbv zeta.
    destruct (Ek h w Hh) as (-> & ->), (Ek k v Hk) as (-> & ->). reflexivity. }
  assert (As : forall t k n, k < K -> asked tau' s t k n -> asked tau s t k n)
    by (intros t k n Hk; unfold asked, earlier_complete, job_complete; rewrite (Eq k Hk); auto).
  constructor.
  - apply (same_tasks K 1 tau); [exact Eq|]. apply (on_one_core _ _ _ _ _ R).
  - intros k Hk. rewrite <- (Eq k Hk). apply (all_regular _ _ _ _ _ R k Hk).
  - intros t k n v Hk W A L Rt X. rewrite <- (Eq k Hk) in W.
    destruct (by_key _ _ _ _ _ R t k n v Hk W (As _ _ _ Hk A) L (Rd _ _ _ _ Hk Rt) X) as (h & n' & w & Hh & Hw & Ww &
      Xw & O).
    exists h, n', w. rewrite <- (Eq h Hh), <- Go; auto 10.
  - intros t k n v Hk W A Rt X h n' w Hh. rewrite <- (Eq k Hk) in W. rewrite <- (Eq h Hh), <- Go by auto.
    apply (begins_by_key _ _ _ _ _ R t k n v Hk W (As _ _ _ Hk A) (Rd _ _ _ _ Hk Rt) X h n' w Hh).
Qed.

Lemma core_claim_of_commit k : k < Commit.number c -> core_at core_claims k = core_claim_at k.
Proof.
  intros Hk. unfold core_at, core_claims. rewrite (nth_indep _ no_core_claim (core_claim_at 0))
    by (rewrite map_length, seq_length; exact Hk).
  rewrite map_nth, seq_nth; auto.
Qed.

(** Each DAG's jobs execute to their ends, and by rank. *)
Definition committed_by_rank (k : nat) : task := with_keeps (committed c k) (kept_at c k) true.

(** *What [judge_core] accepts is true: in every run of the committed DAGs on one core in the order of their keys, at
  any
    resolution N of time, each job of the DAG, and each sink with a bound of its own, is complete within the claimed
    bound,* if losses are no more than charged.  Under EDF releases are at whole ns. *)
Theorem judge_core_sound N s : 0 < N ->
  keyed_run (Commit.number c) (fun k => finer N (committed_by_rank k)) (is_edf c) (finer_key N (is_edf c) stated_keys) s ->
  (is_edf c = true -> forall k n, k < Commit.number c -> exists q, release s k n = N * q) ->
  (forall a x, count (N * x) (fun t => lost s (a + t)) <= N * losses bursts x) ->
  forall k, k < Commit.number c -> nth k judge_core false = true ->
  (forall r, core_bound (more_of k) = Some r ->
     forall n, job_complete (fun k => finer N (committed_by_rank k)) s (release s k n + N * N.to_nat r) k n) /\
  (forall of, In of (core_sinks (more_of k)) ->
     forall n, job_finished s (release s k n + N * N.to_nat (sink_bound of)) k n (sink of)).
Proof.
  intros HN Run Whole Losses k Hk J.
  assert (Len : length core_claims = Commit.number c) by (unfold core_claims; rewrite map_length, seq_length;
    reflexivity).
  assert (Ok : (if claimed (dag_of core_claims k) then core_claim_ok (is_edf c) bursts core_claims k else true) = true /\
    forallb (fun b => b) (core_sinks_ok (is_edf c) bursts core_claims k) = true).
  { unfold judge_core in J. cbv zeta in J.
    set (f := fun k => _) in J. rewrite (nth_indep _ false (f 0)) in J by (rewrite map_length, seq_length; exact Hk).
    rewrite map_nth, seq_nth in J by exact Hk. rewrite Nat.add_0_l in J. unfold f in J.
    match type of J with (if _ && ?b then _ else _) = _ => destruct b eqn:E end; [|rewrite andb_false_r in J; discriminate].
    match type of J with (if ?b then _ else _) = _ => destruct b; [|discriminate] end.
    split; [|exact J]. destruct (claimed (dag_of core_claims k)); auto. }
  assert (Same : forall k, k < Commit.number c -> finer N (committed_by_rank k) = finer N (core_tasks core_claims k)).
  { intros k' Hk'. unfold core_tasks. rewrite core_claim_of_commit by exact Hk'. reflexivity. }
  assert (Run' : keyed_run (length core_claims) (fun k => finer N (core_tasks core_claims k)) (is_edf c)
    (finer_key N (is_edf c) (core_keys core_claims)) s).
  { rewrite Len. apply (keyed_same _ (fun k => finer N (committed_by_rank k)) _ _ (finer_key N (is_edf c) stated_keys)); auto.
    intros k' v Hk'. unfold finer_key, core_keys. cbn [urgent OneCoreStretch.number].
    rewrite core_claim_of_commit by exact Hk'. split; reflexivity. }
  rewrite <- Len in Whole.
  pose proof (Build_core_run (is_edf c) bursts core_claims N s HN Run' Whole Losses) as CoreRun.
  destruct Ok as (Ok & Sinks). split.
  - intros r B n. unfold dag_of in Ok. rewrite core_claim_of_commit in Ok by exact Hk.
    cbn [core_claim_at of_dag with_bound claimed] in Ok. rewrite B in Ok.
    pose proof (one_core_check_sound (is_edf c) bursts core_claims N s CoreRun k Ok n) as Fin.
    unfold dag_of in Fin. rewrite core_claim_of_commit in Fin by exact Hk.
    cbn [core_claim_at of_dag with_bound bound] in Fin. rewrite B in Fin.
    intros v Hv. apply Fin. rewrite Same in Hv by exact Hk. exact Hv.
  - intros of Hof n. unfold core_sinks_ok in Sinks. destruct (places_of core_claims k) as (places, last).
    rewrite forallb_forall in Sinks. apply (sink_check_sound (is_edf c) bursts core_claims N s CoreRun k (fun v => nth
      v places 0) last).
    apply Sinks. apply in_map. unfold core_at. fold (core_at core_claims k). rewrite core_claim_of_commit by exact Hk.
      exact Hof.
Qed.

End commit.

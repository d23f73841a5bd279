(** * What was committed, and the judge of the bounds that are claimed of it

    A commit is stated as a witness has it: cores, the policy's order, and of each DAG its subtasks with their
    segments and waits, priorities, and whether they keep their cores.  Who may delay whom is *computed* from that.
    [judge] says of which DAGs it has shown the claimed bound; [judge_sound] says that it is right. *)

Require Import Arith Lia Bool List NArith.
From Bounds Require Import Sums Model Blocking TaskSet SetBounds Checker AnyResolution.
Import ListNotations.

(** ** The statement *)

Record subtask := {
  priority : N;              (* the smaller, the more urgent *)
  keeps_its_core : bool;     (* until the end of its segment, once it has started *)
  times : list N;            (* WCETs of its segments (0: unknown) and limits of the waits between, in turn; if the last
                                one is 0, but not the first, this is the WCET of all segments together *)
  predecessors : list nat;   (* in the same DAG, of smaller numbers *)
  in_cover : nat;            (* what shows a claim: the number of its chain in a cover of the DAG by chains, *)
  in_part : nat;             (* in a division into chains, *)
  in_chain : nat             (* and among the j + 1 chains of the bound (along a path, j); else a number above j *)
}.

Record dag_statement := {
  subtasks : list subtask;
  least_gap : N;             (* from a release to the next *)
  due : N;                   (* its relative deadline, and the least one of its sinks *)
  least_due : N;
  has_claim : bool;          (* whether a bound is claimed, *)
  claimed_bound : N;         (* which, *)
  claimed_loss : N;          (* if in so many ticks of a window of that length, at most, any core is lost *)
  cover_chains : nat;        (* as many chains are in the cover; 0: there is none, *)
  part_chains : nat;         (* in the division, *)
  beside : nat               (* and besides one of the bound: j *)
}.

Inductive order := Static | Edf | Any.

Record commit := {
  machine_cores : nat;
  ranking : order;
  overhead : N;              (* what each segment is charged *)
  dags : list dag_statement
}.

(** ** Its meaning: segments and waits as vertices *)

Record vertex := { owner : subtask; time : N; is_wait : bool; before : list nat; its_head : nat; all_time : N }.

(** Segments may share a WCET, with the first one, [first]. *)
Fixpoint vertices_of (v : subtask) (charge : N) (first : option (nat * N)) (wait : bool) (at_ : nat) (pre : list nat)
    (ts : list N) : list vertex :=
  match ts with
  | [] => []
  | t :: ts =>
      let own := (if wait || (t =? 0) then t else t + charge)%N in
      {| owner := v; is_wait := wait; before := pre;
         time := match first with Some (_, c) => if wait then t else (c + charge)%N | None => own end;
         its_head := match first with Some (h, _) => if wait then at_ else h | None => at_ end;
         all_time := match first with
           | Some (h, c) => if wait then t
               else if at_ =? h then (c + charge * N.of_nat (S (Nat.div2 (length ts))))%N else 0%N
           | None => own
           end |}
      :: vertices_of v charge first (negb wait) (S at_) [at_] ts
  end.

(** The vertices, predecessors first; [lasts]: of each subtask the last one. *)
Definition expand (charge : N) (vs : list subtask) : list vertex :=
  fst (fold_left (fun (x : list vertex * list nat) v =>
    let (found, lasts) := x in
    let whole := hd 0%N (times v) in
    let first := if ((0 <? whole) && (last (times v) 0 =? 0))%N then Some (length found, whole) else None in
    let new := vertices_of v charge first false (length found) (map (fun u => nth u lasts 0) (predecessors v)) (times v) in
    (found ++ new, lasts ++ [length found + length new - 1])) vs ([], [])).

(** Each subtask has a segment, begins and ends with one, and its predecessors have smaller numbers. *)
Definition subtasks_ok (d : dag_statement) : bool :=
  forallb (fun p => Nat.odd (length (times (snd p))) && forallb (fun u => u <? fst p) (predecessors (snd p)))
    (combine (seq 0 (length (subtasks d))) (subtasks d)) && (0 <? length (subtasks d)).

Definition no_dag : dag_statement :=
  {| subtasks := []; least_gap := 1; due := 1; least_due := 1; has_claim := false; claimed_bound := 0;
     claimed_loss := 0; cover_chains := 0; part_chains := 0; beside := 0 |}.

Section commit.
Variable c : commit.

Definition dag_at (k : nat) : dag_statement := nth k (dags c) no_dag.
Definition number : nat := length (dags c).

(** The most and the least urgent priority of a DAG's subtasks. *)
Definition most_urgent (d : dag_statement) : N :=
  match subtasks d with [] => 0%N | v :: vs => fold_right (fun v p => N.min (priority v) p) (priority v) vs end.
Definition least_urgent (d : dag_statement) : N := fold_right (fun v p => N.max (priority v) p) 0%N (subtasks d).

(** *Who may outrank whom.*  Instances are ranked by the policy's number, then by the number of the DAG.  So under
    static priorities DAG h may outrank DAG k if some subtask of h is ranked before some subtask of k. *)
Definition may_outrank (h k : nat) : bool :=
  match ranking c with
  | Static => let p := most_urgent (dag_at h) in let q := least_urgent (dag_at k) in
              (p <? q)%N || (p =? q)%N && (h <? k)
  | _ => true
  end.

Definition is_edf : bool := match ranking c with Edf => true | _ => false end.

Definition stated : policy := {| by_deadline := is_edf; outranks := may_outrank |}.

Definition all_vertices_of : list vertex := flat_map (fun d => expand (overhead c) (subtasks d)) (dags c).
Definition all_kept : bool := forallb (fun v => is_wait v || keeps_its_core (owner v)) all_vertices_of.
Definition none_kept : bool := forallb (fun v => is_wait v || negb (keeps_its_core (owner v))) all_vertices_of.

(** Where some keep their cores and others do not, every other DAG is taken to outrank, always. *)
Definition exact_order : bool := all_kept || none_kept.
Definition by_due : bool := exact_order && is_edf.
Definition outranking (k : nat) : list nat :=
  filter (fun h => negb (h =? k) && (negb exact_order || may_outrank h k)) (seq 0 number).

(** The q-th largest WCET of what may block DAG k. *)
Fixpoint insert (t : N) (l : list N) : list N :=
  match l with [] => [t] | u :: l' => if (u <=? t)%N then t :: l else u :: insert t l' end.
Definition level (k q : nat) : N :=
  let low h := all_kept && negb (h =? k) && (by_due || negb (existsb (Nat.eqb h) (outranking k))) in
  let ts h := if low h then flat_map (fun v => if is_wait v then [] else [time v])
                              (expand (overhead c) (subtasks (dag_at h))) else [] in
  nth (q - 1) (fold_right insert [] (flat_map ts (seq 0 number))) 0%N.

Definition claim_at (claimed_too : bool) (k : nat) : claim :=
  let d := dag_at k in
  let vs := expand (overhead c) (subtasks d) in
  let m := machine_cores c in
  {| wcets := map time vs; shared := Some (map its_head vs, map all_time vs);
     wait_list := flat_map (fun p => if is_wait (snd p) then [fst p] else []) (combine (seq 0 (length vs)) vs);
     preds := map before vs;
     minimum_period := least_gap d; relative_deadline := due d; least_deadline := least_due d;
     outranked_by := outranking k; keeping := all_kept;
     known_wcets := forallb (fun v => is_wait v || (0 <? time v)%N) vs;
     claimed := claimed_too; bound := claimed_bound d; loss := claimed_loss d;
     width := if cover_chains d =? 0 then m else cover_chains d;
     cover := if cover_chains d =? 0 then None else Some (map (fun v => in_cover (owner v)) vs);
     parts := part_chains d; part_of := map (fun v => in_part (owner v)) vs;
     free_chains := beside d; chain_of := map (fun v => in_chain (owner v)) vs;
     first_level := level k (m - beside d); later_level := level k (Nat.min (m - beside d) (m - 1));
     costless := (overhead c =? 0)%N |}.

(** The DAGs as tasks: as the claims' (Checker.v), but each subtask keeps its core just if it is stated to, and of
    DAGs without claims no rank and no end is asked. *)
Definition with_keeps (t : task) (kept : nat -> bool) (is_regular : bool) : task :=
  {| graph := graph t; wcet := wcet t; head := head t; together := together t; waits := waits t; keeps := kept; regular := is_regular; known := known t;
     period := period t; deadline := deadline t; first_deadline := first_deadline t |}.

Definition kept_at (k v : nat) : bool :=
  match nth_error (expand (overhead c) (subtasks (dag_at k))) v with Some x => keeps_its_core (owner x) | None => false end.

Definition committed (k : nat) : task := with_keeps (stated_task (claim_at true k)) (kept_at k) (has_claim (dag_at k)).

(** ** The judge

    DAGs whose claims are not shown are taken for DAGs without claims, until the rest is shown. *)

Definition claims_with (which : list bool) : list claim :=
  map (fun p => claim_at (snd p) (fst p)) (combine (seq 0 number) which).

Fixpoint settle (n : nat) (which : list bool) : list bool :=
  match n with
  | 0 => which
  | S n =>
      let claims := claims_with which in
      let shown := map (fun p => snd p && claim_ok (machine_cores c) by_due claims (fst p))
                     (combine (seq 0 number) which) in
      if forallb (fun p => Bool.eqb (fst p) (snd p)) (combine which shown) then which else settle n shown
  end.

(** The DAGs whose claims are shown, if the checker accepts these. *)
Definition settled : list bool := settle number (map has_claim (dags c)).
Definition judge : list bool :=
  if (length settled =? number) && forallb (fun k => negb (nth k settled false) || has_claim (dag_at k)) (seq 0 number) &&
     forallb subtasks_ok (dags c) && check (machine_cores c) by_due (claims_with settled)
  then settled else map (fun _ => false) (dags c).

(** ** It is right *)

(** A run keeps rules that allow more. *)
Lemma weaker_rules K m tau pol pol' s kept is_regular :
  global_run K m tau pol s ->
  let tau' := fun k => with_keeps (tau k) (kept k) (is_regular k) in
  (forall k, k < K -> is_regular k = true -> regular (tau k) = true) ->
  (forall k v, k < K -> v < size (graph (tau k)) -> waits (tau k) v = false ->
     kept k v = true -> keeps (tau k) v = true) ->
  (forall k n h n', k < K -> h < K -> may_pass tau pol s k n h n' -> may_pass tau' pol' s k n h n') ->
  (forall h w, h < K -> w < size (graph (tau h)) -> waits (tau h) w = false -> keeps (tau h) w = true ->
     kept h w = true \/ forall k n n', k < K -> may_pass tau' pol' s k n h n') ->
  global_run K m tau' pol' s.
Proof.
  intros R tau' H0 H1 H2 H3. constructor.
  - apply R.
  - apply R.
  - intros k n v Hk Hv. destruct (executions _ _ _ _ _ R k n v Hk Hv) as (A & B). split; auto.
  - apply R.
  - apply R.
  - intros t. apply Nat.le_trans with (2 := cores _ _ _ _ _ R t). apply sum_le. intros k Hk.
    apply sum_le. intros n _. apply sum_le. intros v Hv. unfold on_core, holds_core. simpl.
    specialize (H1 k v Hk Hv). destruct (waits (tau k) v); simpl; [lia|].
    destruct (executes s t k n v); simpl; [lia|]. destruct (kept k v); simpl; [|lia].
    rewrite (H1 eq_refl eq_refl). simpl. lia.
  - intros t k n v Hk Rg W L Rd E Nx. destruct (dispatch _ _ _ _ _ R t k n v Hk (H0 k Hk Rg) W L Rd E Nx) as (A & B). split; [exact A|].
    intros h n' w Hh Hw Ww X. destruct (B h n' w Hh Hw Ww X) as [P|P].
    + left. apply H2; auto.
    + destruct (H3 h w Hh Hw Ww P) as [Q|Q]; [right; exact Q|left; apply Q; auto].
  - intros t k n v Hk Rg W Rd E B Nx h n' w Hh Hw Ww Kw Bw X. apply H2; auto.
    apply (begin_in_order _ _ _ _ _ R t k n v Hk (H0 k Hk Rg) W Rd E B Nx h n' w); auto.
  - intros t k n v Hk Hv W Kp. apply (keeps_core _ _ _ _ _ R t k n v Hk Hv W). apply H1; auto.
  - intros t k n v Hk Rg. apply (waits_go_on _ _ _ _ _ R t k n v Hk (H0 k Hk Rg)).
Qed.

(** Rules of tasks that are the same. *)
Lemma same_tasks K m tau tau' pol s : (forall k, k < K -> tau k = tau' k) -> global_run K m tau pol s ->
  global_run K m tau' pol s.
Proof.
  intros Eq R.
  assert (Rd : forall t k n v, k < K -> instance_ready tau' s t k n v -> instance_ready tau s t k n v)
    by (intros t k n v Hk; unfold instance_ready; rewrite (Eq k Hk); auto).
  assert (Ea : forall t k n, k < K -> earlier_complete tau' s t k n -> earlier_complete tau s t k n)
    by (intros t k n Hk; unfold earlier_complete, job_complete; rewrite (Eq k Hk); auto).
  assert (Mp : forall k n h n', k < K -> h < K -> may_pass tau pol s k n h n' -> may_pass tau' pol s k n h n')
    by (intros k n h n' Hk Hh; unfold may_pass, may_delay; rewrite (Eq k Hk), (Eq h Hh); auto).
  constructor.
  - intros k Hk. rewrite <- (Eq k Hk). apply (periods_positive _ _ _ _ _ R k Hk).
  - intros k n Hk. rewrite <- (Eq k Hk). apply (sporadic _ _ _ _ _ R k n Hk).
  - intros k n v Hk. rewrite <- (Eq k Hk). apply (executions _ _ _ _ _ R k n v Hk).
  - intros k n v Hk. rewrite <- (Eq k Hk). apply (shared_executions _ _ _ _ _ R k n v Hk).
  - intros t k n v Hk. unfold instance_ready. rewrite <- (Eq k Hk). apply (only_ready_execute _ _ _ _ _ R t k n v Hk).
  - intros t. apply Nat.le_trans with (2 := cores _ _ _ _ _ R t). apply sum_le. intros k Hk.
    unfold cores_held, on_core, holds_core. rewrite (Eq k Hk). lia.
  - intros t k n v Hk Rg W L Rt E X. rewrite <- (Eq k Hk) in W, Rg.
    destruct (dispatch _ _ _ _ _ R t k n v Hk Rg W L (Rd _ _ _ _ Hk Rt) (Ea _ _ _ Hk E) X) as (A & B). split.
    + rewrite <- A. apply sum_ext. intros h Hh. unfold task_cores, job_cores, on_core. rewrite (Eq h Hh). reflexivity.
    + intros h n' w Hh. rewrite <- (Eq h Hh). intros Hw Ww Xw. destruct (B h n' w Hh Hw Ww Xw); auto.
  - intros t k n v Hk Rg W Rt E B X h n' w Hh. rewrite <- (Eq k Hk) in W, Rg. rewrite <- (Eq h Hh). intros Hw Ww Kw Bw Xw.
    apply Mp; auto. apply (begin_in_order _ _ _ _ _ R t k n v Hk Rg W (Rd _ _ _ _ Hk Rt) (Ea _ _ _ Hk E) B X h n' w); auto.
  - intros t k n v Hk. rewrite <- (Eq k Hk). apply (keeps_core _ _ _ _ _ R t k n v Hk).
  - intros t k n v Hk Rg W Rt E. rewrite <- (Eq k Hk) in W, Rg. apply (waits_go_on _ _ _ _ _ R t k n v Hk Rg W); auto.
Qed.

Lemma claims_length which : length which = number -> length (claims_with which) = number.
Proof. intros E. unfold claims_with. rewrite map_length, combine_length, seq_length. lia. Qed.

Lemma claim_of_commit which k : length which = number -> k < number ->
  claim_of (claims_with which) k = claim_at (nth k which false) k.
Proof.
  intros E Hk. unfold claim_of, claims_with. rewrite (nth_indep _ no_claim (claim_at (snd (0, false)) (fst (0, false))))
    by (rewrite map_length, combine_length, seq_length; lia).
  rewrite (map_nth (fun p => claim_at (snd p) (fst p))), combine_nth by (rewrite seq_length; auto).
  rewrite seq_nth; auto.
Qed.

Lemma kept_is_stated k v : k < number -> v < length (expand (overhead c) (subtasks (dag_at k))) ->
  exists x, nth_error (expand (overhead c) (subtasks (dag_at k))) v = Some x /\ In x all_vertices_of.
Proof.
  intros Hk Hv. destruct (nth_error (expand (overhead c) (subtasks (dag_at k))) v) as [x|] eqn:E.
  - exists x. split; [auto|]. apply in_flat_map. exists (dag_at k). split; [apply nth_In; exact Hk|].
    apply nth_error_In in E. exact E.
  - apply nth_error_None in E. lia.
Qed.

Lemma waits_of_vertex k v x : nth_error (expand (overhead c) (subtasks (dag_at k))) v = Some x ->
  waits (committed k) v = false -> is_wait x = false.
Proof.
  intros E W. destruct (is_wait x) eqn:Wx; auto. exfalso.
  assert (I : In v (wait_list (claim_at true k))).
  { cbn [claim_at wait_list]. apply in_flat_map. exists (v, x). split.
    - assert (Hv : v < length (expand (overhead c) (subtasks (dag_at k)))) by (apply nth_error_Some; congruence).
      rewrite <- (nth_error_nth _ v x E) at 1.
      pose proof (combine_nth (seq 0 (length (expand (overhead c) (subtasks (dag_at k)))))
        (expand (overhead c) (subtasks (dag_at k))) v 0 x ltac:(apply seq_length)) as C.
      rewrite seq_nth in C by auto. rewrite Nat.add_0_l in C. rewrite <- C. apply nth_In.
      rewrite combine_length, seq_length. lia.
    - simpl. rewrite Wx. left. reflexivity. }
  change (existsb (Nat.eqb v) (wait_list (claim_at true k)) = false) in W.
  assert (existsb (Nat.eqb v) (wait_list (claim_at true k)) = true); [|congruence].
  apply existsb_exists. exists v. split; [exact I|apply Nat.eqb_refl].
Qed.

(** What [judge] accepts the checker accepts, and a run keeps the rules of the claims' tasks and policy. *)
Lemma judged N s k : nth k judge false = true ->
  length settled = number /\ judge = settled /\ check (machine_cores c) by_due (claims_with settled) = true /\
  (global_run number (machine_cores c) (fun k => finer N (committed k)) stated s ->
   global_run number (machine_cores c) (fun k => finer N (stated_tasks (claims_with settled) k))
     (stated_policy by_due (claims_with settled)) s).
Proof.
  intros J. assert (Eq : judge = settled /\ (length settled =? number) &&
    forallb (fun k => negb (nth k settled false) || has_claim (dag_at k)) (seq 0 number) &&
    forallb subtasks_ok (dags c) && check (machine_cores c) by_due (claims_with settled) = true).
  { unfold judge in *. match goal with |- (if ?b then _ else _) = _ /\ _ => destruct b eqn:E end; [auto|]. exfalso. revert J. clear. generalize (dags c) k. induction l as [|d l IH]; intros [|i]; simpl; try discriminate.
    apply IH. }
  destruct Eq as (Eq & E). set (which := settled) in *.
  rewrite !andb_true_iff, Nat.eqb_eq in E. destruct E as (((Len & Has) & _) & Ck). rewrite forallb_forall in Has.
  split; [exact Len|]. split; [exact Eq|]. split; [exact Ck|]. intros R.
  assert (Same : forall k, k < number -> with_keeps (finer N (committed k)) (fun _ => all_kept) (nth k which false)
    = finer N (stated_tasks (claims_with which) k)).
  { intros k' Hk'. unfold stated_tasks. rewrite claim_of_commit by auto. reflexivity. }
  assert (Out : forall h k', h < number -> k' < number ->
    outranks (stated_policy by_due (claims_with which)) h k'
    = negb (h =? k') && (negb exact_order || may_outrank h k')).
  { intros h k' Hh Hk'. cbn [stated_policy outranks]. rewrite claim_of_commit by auto. cbn [claim_at outranked_by].
    unfold outranking. destruct (negb (h =? k') && (negb exact_order || may_outrank h k')) eqn:F.
    - apply existsb_exists. exists h. rewrite Nat.eqb_refl, filter_In, in_seq. split; [split; [lia|exact F]|reflexivity].
    - destruct (existsb _ _) eqn:X; auto. apply existsb_exists in X. destruct X as (h' & I & X).
      apply Nat.eqb_eq in X. subst h'. apply filter_In in I. destruct I as (_ & I). congruence. }
  apply (same_tasks number (machine_cores c) (fun k => with_keeps (finer N (committed k)) (fun _ => all_kept) (nth k which false)));
    [exact Same|].
  apply (weaker_rules _ _ _ _ _ _ (fun _ _ => all_kept) _ R).
  - intros k' Hk' Rg. specialize (Has k' ltac:(apply in_seq; lia)). rewrite Rg in Has. exact Has.
  - intros k' v Hk' Hv W A. change (kept_at k' v = true).
    change (v < length (map time (expand (overhead c) (subtasks (dag_at k'))))) in Hv. rewrite map_length in Hv.
    destruct (kept_is_stated k' v Hk' Hv) as (x & Ex & Ix). unfold kept_at. rewrite Ex.
    pose proof (waits_of_vertex k' v x Ex W) as Wx.
    unfold all_kept in A. rewrite forallb_forall in A. specialize (A x Ix). rewrite Wx in A. exact A.
  - intros k' n0 h n' Hk' Hh [->|P]; [left; reflexivity|]. destruct (Nat.eq_dec h k') as [->|Ne]; [left; reflexivity|right].
    unfold may_delay in *. apply Nat.eqb_neq in Ne. rewrite Out, Ne by auto. apply andb_true_iff in P. destruct P as (P1 & P2).
    cbn [stated outranks] in P1. rewrite P1, orb_true_r. cbn [negb andb]. cbn [stated_policy by_deadline] in *. unfold by_due.
    destruct exact_order; [exact P2|reflexivity].
  - intros h w Hh Hw W Kp. destruct all_kept eqn:A; [left; reflexivity|right].
    intros k' n0 n' Hk'. destruct (Nat.eq_dec h k') as [->|Ne]; [left; reflexivity|right].
    assert (X : exact_order = false).
    { unfold exact_order. rewrite A. destruct none_kept eqn:Nk; auto. exfalso.
      change (kept_at h w = true) in Kp. unfold kept_at in Kp.
      change (w < length (map time (expand (overhead c) (subtasks (dag_at h))))) in Hw. rewrite map_length in Hw.
      destruct (kept_is_stated h w Hh Hw) as (x & Ex & Ix). rewrite Ex in Kp.
      pose proof (waits_of_vertex h w x Ex W) as Wx.
      unfold none_kept in Nk. rewrite forallb_forall in Nk. specialize (Nk x Ix). rewrite Wx, Kp in Nk. discriminate. }
    unfold may_delay. apply Nat.eqb_neq in Ne. rewrite Out, Ne, X by auto. cbn [stated_policy by_deadline].
    unfold by_due. rewrite X. reflexivity.
Qed.

(** *What [judge] accepts is true: in every run that obeys the rules, for the committed DAGs and policy, at any
    resolution N of time, each job of the DAG is complete within the claimed bound,* if losses are no more than charged. *)
Theorem judge_sound N s : 0 < N ->
  global_run number (machine_cores c) (fun k => finer N (committed k)) stated s ->
  (forall k a, k < number -> nth k judge false = true ->
     count (N * N.to_nat (claimed_bound (dag_at k))) (fun t => lost s (a + t)) <= N * N.to_nat (claimed_loss (dag_at k))) ->
  forall k n, k < number -> nth k judge false = true ->
    job_complete (fun k => finer N (committed k)) s (release s k n + N * N.to_nat (claimed_bound (dag_at k))) k n.
Proof.
  intros HN R L k n Hk J. destruct (judged N s k J) as (Len & Eq & Ck & R'). specialize (R' R). rewrite Eq in *.
  pose proof (claims_length settled Len) as K0. rewrite <- K0 in *.
  pose proof (check_sound_in_fractions N HN (machine_cores c) by_due (claims_with settled) Ck s R') as S.
  assert (Fin : job_complete (fun k => finer N (stated_tasks (claims_with settled) k)) s
    (release s k n + N * N.to_nat (bound (claim_of (claims_with settled) k))) k n).
  { apply S; [|exact Hk|rewrite claim_of_commit by (auto; lia); exact J].
    intros k' a Hk'. rewrite claim_of_commit by (auto; lia). intros C. apply L; auto. }
  intros v Hv. unfold job_complete, stated_tasks in Fin. rewrite claim_of_commit in Fin by (auto; lia). apply Fin. exact Hv.
Qed.

End commit.

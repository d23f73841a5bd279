(** * One core: the subtasks of a job start in one order

    [in_order]: of those that are ready by edges always the one with the least key is first, whatever other jobs do,
    in all runs.  So it is known which subtask is executed last. *)

Require Import Arith Lia Bool List.
From Bounds Require Import Sums Model TaskSet AnyResolution OneCoreStretch OneCore.

(** [place v]: the place of subtask v in the order.  If y is before x, then y has the lesser key, or x is not ready by
    edges where y is next: a predecessor is y or comes later. *)
Definition start_order (tau : nat -> task) (key : keys) (k : nat) (place : nat -> nat) : Prop :=
  (forall u w, edge (graph (tau k)) u w = true -> place u < place w) /\
  forall x y, x < size (graph (tau k)) -> y < size (graph (tau k)) -> place y < place x ->
    key k y < key k x \/ key k y = key k x /\ number key k y < number key k x \/
    exists u, edge (graph (tau k)) u x = true /\ (u = y \/ place y < place u).

Section order.
Variables (K : nat) (tau : nat -> task) (edf : bool) (key : keys) (s : set_run).
Variables (k : nat) (place : nat -> nat).
Hypothesis rules : keyed_run K tau edf key s.
Hypothesis in_K : k < K.
Hypothesis keys_up : forall u w, edge (graph (tau k)) u w = true -> key k u <= key k w.
Hypothesis no_waits : forall w, w < size (graph (tau k)) -> waits (tau k) w = false.
Hypothesis order : start_order tau key k place.

Let plain := on_one_core _ _ _ _ _ rules.

Lemma first_unfinished t n : forall c y, place y < c -> y < size (graph (tau k)) -> ~ job_finished s t k n y ->
  exists z, place z <= place y /\ z < size (graph (tau k)) /\ ~ job_finished s t k n z /\
    forall u, u < size (graph (tau k)) -> place u < place z -> job_finished s t k n u.
Proof.
  induction c as [|c IH]; intros y Hc Hy F; [lia|].
  destruct (some_or_none (size (graph (tau k)))
    (fun u => (place u <? place y) && negb (job_exec s k n u <=? job_done s t k n u))) as [(u & Hu & E)|N].
  - rewrite andb_true_iff, Nat.ltb_lt, negb_true_iff, Nat.leb_gt in E. destruct E as (L & D).
    destruct (IH u ltac:(lia) Hu ltac:(unfold job_finished; lia)) as (z & Hz & Z). exists z. split; [lia|exact Z].
  - exists y. split; [lia|]. split; [auto|]. split; [auto|]. intros u Hu L. specialize (N u Hu).
    apply Nat.ltb_lt in L. rewrite L in N. simpl in N. apply negb_false_iff, Nat.leb_le in N. exact N.
Qed.

Lemma finished_has_executed t n v : v < size (graph (tau k)) -> job_finished s t k n v ->
  exists i, i < t /\ executes s i k n v = true.
Proof.
  intros Hv F. pose proof (proj1 (executions _ _ _ _ _ plain k n v in_K Hv) (no_waits v Hv) (all_regular _ _ _ _ _ rules k in_K)).
  assert (Pos : 0 < job_done s t k n v) by (unfold job_finished in F; lia).
  apply sum_positive in Pos. destruct Pos as (i & Hi & E).
  destruct (executes s i k n v) eqn:Ei; simpl in E; [eauto|lia].
Qed.

(** What begins goes before all that is ready. *)
Lemma begins_first t n x m u :
  x < size (graph (tau k)) -> executes s t k n x = true -> has_begun s t k n x = false ->
  instance_ready tau s t k m u -> executes s t k m u = false -> goes_before edf key s k n x k m u = true.
Proof.
  intros Hx Ex Bg Rd Nx. pose proof Rd as (Hu & _).
  apply (begins_by_key _ _ _ _ _ rules t k m u in_K (no_waits u Hu) (or_introl no_waits) Rd Nx k n x); auto.
Qed.

Lemma in_order n : forall t x y, x < size (graph (tau k)) -> y < size (graph (tau k)) ->
  executes s t k n x = true -> place y < place x -> job_finished s t k n y.
Proof.
  destruct order as (Up & Least). intros t. induction t as [t IH] using (well_founded_induction lt_wf).
  intros x y0 Hx Hy0 Ex L0.
  destruct (le_lt_dec (job_exec s k n y0) (job_done s t k n y0)) as [F|F0]; [exact F|exfalso].
  destruct (first_unfinished t n (S (place y0)) y0 ltac:(lia) Hy0 ltac:(unfold job_finished; lia))
    as (y & Ly & Hy & F & Before).
  assert (L : place y < place x) by lia. clear y0 Hy0 L0 F0 Ly.
  (* x begins now *)
  destruct (has_begun s t k n x) eqn:Bg.
  { unfold has_begun in Bg. apply Nat.ltb_lt, sum_positive in Bg. destruct Bg as (i & Hi & E).
    destruct (executes s i k n x) eqn:Ei; [|simpl in E; lia].
    apply F. apply job_finished_later with i; [lia|]. apply (IH i Hi x y); auto. }
  pose proof (executing_is_ready K tau edf key s rules t k n x in_K Hx Ex) as (_ & Rel & _ & Anc & _).
  (* it is ready by edges where y is next, so y has the lesser key *)
  assert (Lex : key k y < key k x \/ key k y = key k x /\ number key k y < number key k x).
  { destruct (Least x y Hx Hy L) as [H|[H|(u & E & U)]]; [auto|auto|exfalso].
    pose proof (edges_lead_up _ _ _ E). pose proof (Anc u (precedes_edge _ _ _ E)) as Fu.
    destruct U as [->|U]; [contradiction|].
    destruct (finished_has_executed t n u ltac:(lia) Fu) as (i & Hi & Ei).
    apply F. apply job_finished_later with i; [lia|]. apply (IH i Hi u y); auto; lia. }
  assert (Ancestors : forall u, precedes (graph (tau k)) u y -> job_finished s t k n u).
  { intros u P. assert (place u < place y).
    { clear -P Up. induction P as [v E|v w P IH E]; [auto|]. specialize (Up v w E). lia. }
    apply Before; [|auto]. pose proof (precedes_up _ _ _ P). lia. }
  destruct (some_or_none n (fun m => negb (job_exec s k m y <=? job_done s t k m y))) as [(m & Hm & E)|None].
  - (* an ancestor of y in an earlier job is ready *)
    apply negb_true_iff, Nat.leb_gt in E.
    set (counts h i w := (h =? k) && (i <? n) && (key k w <=? key k y)).
    assert (Spec : forall h i w, counts h i w = true <-> h = k /\ i < n /\ key k w <= key k y).
    { intros. unfold counts. rewrite !andb_true_iff, Nat.eqb_eq, Nat.ltb_lt, Nat.leb_le. tauto. }
    destruct (some_ready K tau edf key s rules counts) with (t := t) (h := k) (n := m) (w := y)
      as (m' & u & C & Rd); auto.
    + intros h i v w Hh C Ed. apply Spec in C. destruct C as (-> & Hi & Kw). apply Spec.
      pose proof (keys_up v w Ed). split; [auto|]. split; [auto|lia].
    + intros h i' i w _ _ Hi C. apply Spec in C. apply Spec. split; [tauto|]. split; [lia|tauto].
    + intros h i w _ _ C v Hv. apply Spec in C. destruct C as (-> & _). apply no_waits, Hv.
    + split; [auto|]. split; [auto|]. split; [apply Spec; auto|]. unfold job_finished. lia.
    + pose proof (releases_grow K tau edf key s rules k m n in_K Hm). lia.
    + apply Spec in C. destruct C as (_ & Hm' & Ku).
      assert (Nx : executes s t k m' u = false).
      { destruct (executes s t k m' u) eqn:Eu; auto. pose proof Rd as (Hu & _).
        destruct (one_at_a_time K tau edf key s rules t k n x k m' u) as (_ & -> & _); [| |lia];
          apply executing_on_the_core; auto. }
      pose proof (begins_first t n x m' u Hx Ex Bg Rd Nx) as B.
      pose proof (releases_grow K tau edf key s rules k m' n in_K Hm') as R.
      pose proof (periods_positive _ _ _ _ _ plain k in_K) as P.
      unfold urgency in *. clear -B Hm' Ku Lex R P. unfold goes_before, urgency in B. destruct edf; by_keys; lia.
  - (* y is ready *)
    assert (Rd : instance_ready tau s t k n y).
    { split; [auto|]. split; [auto|]. split; [auto|]. split; [exact Ancestors|].
      intros m Hm. specialize (None m Hm). apply negb_false_iff, Nat.leb_le in None. exact None. }
    assert (Nx : executes s t k n y = false).
    { destruct (executes s t k n y) eqn:Ey; auto.
      destruct (one_at_a_time K tau edf key s rules t k n x k n y) as (_ & _ & ->); [| |lia];
        apply executing_on_the_core; auto. }
    pose proof (begins_first t n x n y Hx Ex Bg Rd Nx) as B.
    clear -B Lex. unfold goes_before, urgency in B. destruct edf; by_keys; lia.
Qed.

(** What goes before a subtask that is ready, in its job, has an earlier place. *)
Lemma first_is_earlier n t v w : instance_ready tau s t k n v -> instance_ready tau s t k n w ->
  goes_before edf key s k n w k n v = true -> place w <= place v.
Proof.
  intros (Hv & _ & Fv & _) (Hw & _ & _ & Anc & _) B. destruct (le_lt_dec (place w) (place v)) as [L|L]; [exact
    L|exfalso].
  destruct order as (_ & Least). destruct (Least w v Hw Hv L) as [H|[H|(u & E & U)]].
  1, 2: clear -B H; unfold goes_before, urgency in B; destruct edf; by_keys; lia.
  pose proof (edges_lead_up _ _ _ E). pose proof (Anc u (precedes_edge _ _ _ E)) as Fu.
  destruct U as [->|U]; [contradiction|].
  destruct (finished_has_executed t n u ltac:(lia) Fu) as (i & Hi & Ei).
  apply Fv. apply job_finished_later with i; [lia|]. apply (in_order n i u v); auto. lia.
Qed.

End order.

(** The order of the ns is that of the ticks. *)
Lemma finer_order N tau edf key k place : 0 < N ->
  start_order tau key k place -> start_order (fun k => finer N (tau k)) (finer_key N edf key) k place.
Proof.
  intros HN (O1 & O2). split; [exact O1|]. intros x y Hx Hy L. unfold finer_key. cbn [urgent number].
  specialize (O2 x y Hx Hy L). simpl.
  destruct edf; [|exact O2]. destruct O2 as [H|[(H & H')|H]]; [left; nia|right; left; split; [nia|auto]|auto].
Qed.

(** In all runs the subtask with the last place is executed last. *)
Theorem order_tells_last K N tau edf key s k last place :
  0 < N -> keyed_run K (fun k => finer N (tau k)) edf (finer_key N edf key) s ->
  k < K ->
  (forall u w, edge (graph (tau k)) u w = true -> key k u <= key k w) ->
  (forall w, w < size (graph (tau k)) -> waits (tau k) w = false) ->
  start_order tau key k place ->
  last < size (graph (tau k)) -> (forall v, v < size (graph (tau k)) -> v <> last -> place v < place last) ->
  executed_last tau k s last.
Proof.
  intros HN Rules Hk Up W (O1 & O2) Hl Last. split; [exact Hl|]. intros t n v E Hv Ne.
  apply (in_order K (fun k => finer N (tau k)) edf (finer_key N edf key) s k place Rules) with (x := last); auto.
  - intros u w Ed. specialize (Up u w Ed). unfold finer_key. cbn [urgent]. destruct edf; nia.
  - split; [exact O1|]. intros x y Hx Hy L. unfold finer_key. cbn [urgent number]. specialize (O2 x y Hx Hy L). simpl.
    destruct edf; [|exact O2]. destruct O2 as [H|[(H & H')|H]]; [left; nia|right; left; split; [nia|auto]|auto].
Qed.

(** * A checker of claimed bounds, and the proof that it is right

    [check m due_no_later claims] computes; [check_sound] says that what it accepts is true of all runs.
    Times are binary numbers, so that nanoseconds can be checked.  Nothing is searched for: what the claims say is verified.
    Ancestors and lengths are computed by code that need not be trusted, and then verified. *)

Require Import Arith Lia Bool List NArith.
From Bounds Require Import Sums Model Chains Shares OneTick Account ResponseTime Blocking Workload TaskSet
  Windows SetBounds.
Import ListNotations.

(** A DAG and the bound claimed for it.  Vertices are numbered such that predecessors come first.

    What is claimed: *)
Record claim := {
  wcets : list N;               (* by vertex *)
  shared : option (list nat * list N);  (* by vertex its head, and the WCET of all together; or no two share one *)
  wait_list : list nat;         (* the vertices that are waits; their WCETs are the waits' limits *)
  preds : list (list nat);      (* by vertex: its predecessors *)
  minimum_period : N;
  relative_deadline : N;        (* this and the next matter under EDF only *)
  least_deadline : N;           (* the least of its sinks' *)
  outranked_by : list nat;      (* the DAGs that may outrank this one *)
  keeping : bool;               (* whether all its subtasks keep their cores until they end *)
  known_wcets : bool;           (* else the WCETs are of no matter, and nothing is assumed of its executions *)
  claimed : bool;               (* without a claim the DAG is only there, and the rest does not matter *)
  bound : N;
  loss : N;                     (* in so many ticks of any window as long as the bound, at most, *any* core is lost *)
  (* and what shows it: *)
  width : nat;                  (* on so many cores a job executes at most: *)
  cover : option (list nat);    (* m, or as many as these chains are; by vertex: its chain *)
  parts : nat;                  (* so many disjoint chains, for the work of this DAG in others' inequalities; *)
  part_of : list nat;           (* by vertex: its chain, or a number from [parts] on *)
  free_chains : nat;            (* j *)
  chain_of : list nat;          (* by vertex: its chain among j + 1 disjoint ones (along a path, j), or a number above j *)
  first_level : N;              (* the (m - j)-th largest WCET of those that block, *)
  later_level : N;              (* and the (m - max(j, 1))-th; any numbers are right, these are best *)
  costless : bool               (* whether the platform's own time is no matter: else widths are of none *)
}.

Definition no_claim : claim :=
  {| wcets := []; shared := None; wait_list := []; preds := []; minimum_period := 1; relative_deadline := 1;
     least_deadline := 1; outranked_by := []; keeping := false; known_wcets := false; claimed := false; bound := 0; loss := 0; width := 0; cover := None;
     parts := 0; part_of := []; free_chains := 0; chain_of := []; first_level := 0; later_level := 0; costless := false |}.

(** ** What a claim is about *)

Definition vertices (c : claim) : nat := length (wcets c).

Definition listed_edge (n : nat) (before : list (list nat)) (u v : nat) : bool :=
  (u <? v) && (v <? n) && existsb (Nat.eqb u) (nth v before []).

Lemma listed_edges_lead_up n before u v : listed_edge n before u v = true -> u < v < n.
Proof. unfold listed_edge. rewrite !andb_true_iff, !Nat.ltb_lt. tauto. Qed.

Definition stated_edge (c : claim) : nat -> nat -> bool := listed_edge (vertices c) (preds c).

Definition stated_dag (c : claim) : dag :=
  {| size := vertices c; edge := stated_edge c; edges_lead_up := listed_edges_lead_up (vertices c) (preds c) |}.

Definition wcetN (c : claim) (v : nat) : N := nth v (wcets c) 0%N.

Definition head_of (c : claim) (v : nat) : nat := match shared c with Some (h, _) => nth v h v | None => v end.

Definition togetherN (c : claim) (v : nat) : N := match shared c with Some (_, t) => nth v t 0%N | None => wcetN c v end.

Definition stated_task (c : claim) : task :=
  {| graph := stated_dag c;
     wcet := fun v => N.to_nat (wcetN c v);
     head := head_of c;
     together := fun v => N.to_nat (togetherN c v);
     waits := fun v => existsb (Nat.eqb v) (wait_list c);
     keeps := fun _ => keeping c;
     regular := claimed c; known := known_wcets c;
     period := N.to_nat (minimum_period c);
     deadline := N.to_nat (relative_deadline c);
     first_deadline := N.to_nat (least_deadline c) |}.

Definition claim_of (claims : list claim) (k : nat) : claim := nth k claims no_claim.

Definition stated_tasks (claims : list claim) (k : nat) : task := stated_task (claim_of claims k).

Definition stated_policy (due_no_later : bool) (claims : list claim) : policy :=
  {| by_deadline := due_no_later;
     outranks := fun h k => existsb (Nat.eqb h) (outranked_by (claim_of claims k)) |}.

(** ** Sums and workloads in binary numbers *)

Fixpoint sumN (n : nat) (f : nat -> N) : N :=
  match n with
  | 0 => 0%N
  | S k => (sumN k f + f k)%N
  end.

Lemma sumN_ok n f g : (forall i, i < n -> N.to_nat (f i) = g i) -> N.to_nat (sumN n f) = sum n g.
Proof.
  induction n; cbn [sumN sum]; intros H; [reflexivity|].
  rewrite N2Nat.inj_add, IHn, H; auto.
Qed.

Definition workloadN (V p R T r : N) : N :=
  let V1 := N.min V (p * R) in
  let A := (p * (r + R) - V1)%N in
  N.min (A / (p * T) * V1 + N.min V1 (A mod (p * T))) (p * r).

Definition workload_by_deadlineN (V p R T Dk D : N) : N :=
  let V1 := N.min V (p * R) in
  let n := if (D <=? Dk)%N then ((Dk - D) / T + 1)%N else 0%N in
  (n * V1 + N.min V1 (p * (Dk + R - n * T - D)))%N.

Definition window_workN (cut : option (N * N)) (V p R T r : N) : N :=
  match cut with
  | None => workloadN V p R T r
  | Some (Dk, D) => N.min (workloadN V p R T r) (workload_by_deadlineN V p R T Dk D)
  end.

Ltac to_nat := repeat rewrite ?N2Nat.inj_min, ?N2Nat.inj_add, ?N2Nat.inj_mul, ?N2Nat.inj_div,
  ?N2Nat.inj_mod, ?N2Nat.inj_sub.

Lemma workloadN_ok V p R T r :
  N.to_nat (workloadN V p R T r)
  = workload (N.to_nat V) (N.to_nat p) (N.to_nat R) (N.to_nat T) (N.to_nat r).
Proof. unfold workloadN, workload. cbv zeta. to_nat. reflexivity. Qed.

Lemma workload_by_deadlineN_ok V p R T Dk D :
  N.to_nat (workload_by_deadlineN V p R T Dk D)
  = workload_by_deadline (N.to_nat V) (N.to_nat p) (N.to_nat R) (N.to_nat T) (N.to_nat Dk) (N.to_nat D).
Proof.
  unfold workload_by_deadlineN, workload_by_deadline. cbv zeta.
  destruct (N.leb_spec D Dk), (Nat.leb_spec (N.to_nat D) (N.to_nat Dk)); try lia; to_nat; reflexivity.
Qed.

Lemma window_workN_ok cut V p R T r :
  N.to_nat (window_workN cut V p R T r)
  = window_work (match cut with Some (Dk, D) => Some (N.to_nat Dk, N.to_nat D) | None => None end)
      (N.to_nat V) (N.to_nat p) (N.to_nat R) (N.to_nat T) (N.to_nat r).
Proof.
  unfold window_workN, window_work. destruct cut as [(Dk, D)|]; [|apply workloadN_ok].
  rewrite N2Nat.inj_min, workloadN_ok, workload_by_deadlineN_ok. reflexivity.
Qed.

Definition weightN (c : claim) (w : nat -> N) (k : nat -> bool) : N :=
  sumN (vertices c) (fun v => if k v then w v else 0%N).

Lemma weightN_ok c w k : N.to_nat (weightN c w k) = weight (stated_dag c) (fun v => N.to_nat (w v)) k.
Proof. apply sumN_ok. intros v _. destruct (k v); reflexivity. Qed.

Definition left_overN (c : claim) (j : nat) (f : nat -> nat) : N :=
  weightN c (togetherN c) (fun v => negb (f v <=? j)).

Lemma left_overN_ok c j f :
  N.to_nat (left_overN c j f) = left_over (stated_dag c) (fun v => N.to_nat (togetherN c v)) j f.
Proof. apply sumN_ok. intros v _. destruct (f v <=? j); reflexivity. Qed.

(** ** The graph: ancestors and lengths *)

(** Sets of vertices as bits.  [ancestors_from] is what a vertex has by the sets of its predecessors. *)
Definition ancestors_from (anc : list N) (l : list nat) : N :=
  fold_right (fun u s => N.lor (N.lor (N.shiftl 1 (N.of_nat u)) (nth u anc 0%N)) s) 0%N l.

Definition ancestors (c : claim) : list N :=
  fold_left (fun anc l => anc ++ [ancestors_from anc l]) (preds c) [].

Definition level_from (lv : list N) (l : list nat) : N :=
  fold_right (fun u s => N.max (nth u lv 0%N) s) 0%N l.

(** The heaviest path to each vertex. *)
Definition levels (c : claim) (w : nat -> N) : list N :=
  fold_left (fun lv l => lv ++ [(level_from lv l + w (length lv))%N]) (preds c) [].

Definition all_vertices (c : claim) (p : nat -> bool) : bool := forallb p (seq 0 (vertices c)).

Lemma all_vertices_true c p : all_vertices c p = true -> forall v, v < vertices c -> p v = true.
Proof.
  unfold all_vertices. rewrite forallb_forall. intros H v Hv. apply H. apply in_seq. lia.
Qed.

Definition edges_ok (c : claim) : bool :=
  (length (preds c) =? vertices c) &&
  all_vertices c (fun v => forallb (fun u => u <? v) (nth v (preds c) [])).

Definition ancestors_ok (c : claim) (anc : list N) : bool :=
  all_vertices c (fun v => (nth v anc 0 =? ancestors_from anc (nth v (preds c) []))%N).

Definition levels_ok (c : claim) (w : nat -> N) (lv : list N) (len : N) : bool :=
  all_vertices c (fun v =>
    (nth v lv 0 =? level_from lv (nth v (preds c) []) + w v)%N && (nth v lv 0 <=? len)%N).

Definition is_ancestor (anc : list N) (u v : nat) : bool := N.testbit (nth v anc 0%N) (N.of_nat u).

Lemma stated_edge_of_pred c u v :
  edges_ok c = true -> v < vertices c -> In u (nth v (preds c) []) -> stated_edge c u v = true.
Proof.
  intros E Hv Hu. unfold edges_ok in E. apply andb_true_iff in E. destruct E as (_ & E).
  apply (all_vertices_true c _ E) in Hv as Huv. rewrite forallb_forall in Huv.
  specialize (Huv u Hu). apply Nat.ltb_lt in Huv.
  unfold stated_edge, listed_edge. rewrite !andb_true_iff, !Nat.ltb_lt. split; [auto|].
  apply existsb_exists. exists u. split; auto. apply Nat.eqb_refl.
Qed.

Lemma ancestors_from_bit anc l u :
  N.testbit (ancestors_from anc l) (N.of_nat u) = true ->
  exists p, In p l /\ (u = p \/ is_ancestor anc u p = true).
Proof.
  induction l as [|p l IH]; cbn [ancestors_from fold_right].
  - rewrite N.bits_0. discriminate.
  - rewrite !N.lor_spec, !orb_true_iff. intros [[H|H]|H].
    + exists p. split; [left; auto|left].
      rewrite N.shiftl_1_l, N.pow2_bits_eqb in H. apply N.eqb_eq in H. lia.
    + exists p. split; [left; auto|right; exact H].
    + destruct (IH H) as (q & Hq & D). exists q. split; [right; auto|auto].
Qed.

Lemma is_ancestor_precedes c anc u v :
  edges_ok c = true -> ancestors_ok c anc = true -> v < vertices c ->
  is_ancestor anc u v = true -> precedes (stated_dag c) u v.
Proof.
  intros E A. revert v. induction v as [v IH] using (well_founded_induction lt_wf).
  intros Hv H. pose proof (all_vertices_true c _ A v Hv) as Eq. apply N.eqb_eq in Eq.
  unfold is_ancestor in H. rewrite Eq in H.
  apply ancestors_from_bit in H. destruct H as (p & Hp & D).
  pose proof (stated_edge_of_pred c p v E Hv Hp) as Ep.
  pose proof (listed_edges_lead_up _ _ p v Ep).
  destruct D as [->|D].
  - apply precedes_edge. auto.
  - apply precedes_further with p; auto. apply IH; auto; lia.
Qed.

Lemma level_from_at_least lv l u : In u l -> (nth u lv 0 <= level_from lv l)%N.
Proof.
  induction l as [|p l IH]; cbn [level_from fold_right]; intros H; [destruct H|].
  destruct H as [->|H]; [apply N.le_max_l|].
  specialize (IH H). unfold level_from in IH. lia.
Qed.

Lemma levels_bound c w lv len :
  edges_ok c = true -> levels_ok c w lv len = true ->
  no_path_longer (stated_dag c) (fun v => N.to_nat (w v)) (N.to_nat len).
Proof.
  intros E L l.
  assert (H : forall l, path (stated_dag c) l ->
    match l with
    | [] => True
    | v :: _ => v < vertices c /\
        path_length (fun v => N.to_nat (w v)) l <= N.to_nat (nth v lv 0%N)
    end).
  { clear l. induction l as [|v l IH]; intros P; auto.
    destruct P as (Hv & Ed & P). simpl in Hv. split; [exact Hv|].
    pose proof (all_vertices_true c _ L v Hv) as Q. cbv beta in Q.
    apply andb_true_iff in Q. destruct Q as (Q & _). apply N.eqb_eq in Q.
    specialize (IH P). unfold path_length in *. cbn [map]. 
    simpl. rewrite Q, N2Nat.inj_add.
    destruct l as [|u l]; [simpl; lia|].
    destruct IH as (Hu & IH). simpl in Ed.
    assert (Iu : In u (nth v (preds c) [])).
    { unfold stated_edge, listed_edge in Ed. apply andb_true_iff in Ed. destruct Ed as (_ & Ed).
      apply existsb_exists in Ed. destruct Ed as (x & Hx & Ex). apply Nat.eqb_eq in Ex. subst. auto. }
    pose proof (level_from_at_least lv _ u Iu). simpl in *. lia. }
  intros P. specialize (H l P). destruct l as [|v l]; [unfold path_length; simpl; lia|].
  destruct H as (Hv & H). pose proof (all_vertices_true c _ L v Hv) as Q. cbv beta in Q.
  apply andb_true_iff in Q. destruct Q as (_ & Q). apply N.leb_le in Q. lia.
Qed.

(** ** Chains *)

Definition label (l : list nat) (v : nat) : nat := nth v l 0.

(** Any two vertices with the same label below [n] are ordered. *)
Definition chains_ok (c : claim) (anc : list N) (l : list nat) (n : nat) : bool :=
  all_vertices c (fun v =>
    (n <=? label l v) ||
    forallb (fun u => negb (label l u =? label l v) || is_ancestor anc u v) (seq 0 v)).

Definition width_ok (c : claim) (anc : list N) (m : nat) : bool :=
  match cover c with
  | None => width c =? m
  | Some l => all_vertices c (fun v => label l v <? width c) && chains_ok c anc l (width c)
  end.

Lemma chains_ok_sound c anc l n :
  edges_ok c = true -> ancestors_ok c anc = true -> chains_ok c anc l n = true ->
  disjoint_parts (stated_dag c) n (label l).
Proof.
  intros E A C u v H Hv Eq Le. simpl in Hv.
  pose proof (all_vertices_true c _ C v Hv) as Q. cbv beta in Q.
  apply orb_true_iff in Q. destruct Q as [Q|Q]; [apply Nat.leb_le in Q; lia|].
  rewrite forallb_forall in Q. specialize (Q u). rewrite in_seq in Q. specialize (Q ltac:(lia)).
  apply orb_true_iff in Q. destruct Q as [Q|Q].
  - rewrite Eq, Nat.eqb_refl in Q. discriminate.
  - apply (is_ancestor_precedes c anc); auto.
Qed.

Lemma cover_ok_sound c anc m l :
  edges_ok c = true -> ancestors_ok c anc = true -> width_ok c anc m = true -> cover c = Some l ->
  chain_cover (stated_dag c) (width c) (label l).
Proof.
  intros E A W Co. unfold width_ok in W. rewrite Co in W. apply andb_true_iff in W. destruct W as (B & C).
  assert (B' : forall v, v < vertices c -> label l v < width c).
  { intros v Hv. apply Nat.ltb_lt. apply (all_vertices_true c _ B v Hv). }
  split; [exact B'|].
  intros u v H Hv Eq. apply (chains_ok_sound c anc l (width c) E A C); auto.
Qed.

Lemma width_ok_sound c anc m tau k :
  graph (tau k) = stated_dag c ->
  edges_ok c = true -> ancestors_ok c anc = true -> width_ok c anc m = true ->
  enough_cores m tau k (width c).
Proof.
  intros G E A W. unfold enough_cores. rewrite G. destruct (cover c) as [l|] eqn:Co.
  - right. exists (label l). apply (cover_ok_sound c anc m l E A W Co).
  - left. unfold width_ok in W. rewrite Co in W. apply Nat.eqb_eq, W.
Qed.

(** ** Segments that share a WCET

    One that is not its head has one predecessor, and this one has one, of the same head and in the same chains. *)
Definition heads_ok (c : claim) : bool := all_vertices c (fun v =>
  (head_of c v =? v) ||
  match nth v (preds c) [] with
  | [w] => match nth w (preds c) [] with
    | [u] => (head_of c u =? head_of c v) && Bool.eqb (existsb (Nat.eqb u) (wait_list c)) (existsb (Nat.eqb v) (wait_list c))
             && (label (part_of c) u =? label (part_of c) v) && (label (chain_of c) u =? label (chain_of c) v)
    | _ => false
    end
  | _ => false
  end).

Lemma heads_ok_sound c : edges_ok c = true -> heads_ok c = true ->
  heads_first (stated_dag c) (head_of c) /\ forall v, v < vertices c ->
  existsb (Nat.eqb (head_of c v)) (wait_list c) = existsb (Nat.eqb v) (wait_list c) /\
  label (part_of c) (head_of c v) = label (part_of c) v /\ label (chain_of c) (head_of c v) = label (chain_of c) v.
Proof.
  intros E Hd.
  assert (Only : forall w u, nth w (preds c) [] = [u] -> forall z, stated_edge c z w = true -> z = u).
  { intros w u P z Ez. unfold stated_edge, listed_edge in Ez. rewrite P in Ez. apply andb_true_iff in Ez.
    destruct Ez as (_ & Ez). simpl in Ez. rewrite orb_false_r in Ez. apply Nat.eqb_eq, Ez. }
  assert (Local : forall v, v < vertices c -> head_of c v = v \/ exists w u,
    stated_edge c u w = true /\ stated_edge c w v = true /\ head_of c u = head_of c v /\
    (forall z, stated_edge c z v = true -> z = w) /\ (forall z, stated_edge c z w = true -> z = u) /\
    existsb (Nat.eqb u) (wait_list c) = existsb (Nat.eqb v) (wait_list c) /\
    label (part_of c) u = label (part_of c) v /\ label (chain_of c) u = label (chain_of c) v).
  { intros v Hv. pose proof (all_vertices_true c _ Hd v Hv) as Q. cbv beta in Q.
    apply orb_true_iff in Q. destruct Q as [Q|Q]; [left; apply Nat.eqb_eq, Q|right].
    destruct (nth v (preds c) []) as [|w [|]] eqn:Pv; try discriminate.
    destruct (nth w (preds c) []) as [|u [|]] eqn:Pw; try discriminate.
    rewrite !andb_true_iff, !Nat.eqb_eq in Q. destruct Q as (((Q1 & Q2) & Q3) & Q4). apply eqb_prop in Q2.
    assert (Ew : stated_edge c w v = true) by (apply stated_edge_of_pred; auto; rewrite Pv; left; reflexivity).
    pose proof (listed_edges_lead_up _ _ w v Ew).
    exists w, u. split; [apply stated_edge_of_pred; auto; [lia|rewrite Pw; left; reflexivity]|].
    split; [exact Ew|]. split; [exact Q1|]. split; [apply (Only v w Pv)|]. split; [apply (Only w u Pw)|]. auto. }
  assert (Heads : heads_first (stated_dag c) (head_of c)).
  { intros v Hv. destruct (Local v Hv) as [L|(w & u & E1 & E2 & L1 & L2 & L3 & _)]; [auto|right]. exists w, u. auto. }
  split; [exact Heads|]. intros v Hv.
  pose proof (of_head (stated_dag c) (head_of c) _ (fun v => (existsb (Nat.eqb v) (wait_list c),
    (label (part_of c) v, label (chain_of c) v)))) as H.
  cbv beta in H. specialize (H ltac:(intros z Hz; destruct (Local z Hz) as [L|(w & u & E1 & E2 & L1 & _ & _ & L2 & L3 & L4)];
    [auto|right]; exists u; pose proof (listed_edges_lead_up _ _ u w E1); pose proof (listed_edges_lead_up _ _ w z E2);
    split; [lia|]; split; [exact L1|]; rewrite L2, L3, L4; reflexivity) v Hv).
  injection H. auto.
Qed.

(** ** Blocking: how often *)

Definition has_some {A} (l : list A) : bool := match l with [] => false | _ => true end.

(** The vertices with a predecessor. *)
Definition followers (c : claim) : nat := count (vertices c) (fun v => has_some (nth v (preds c) [])).

Lemma followers_ok c : count (vertices c) (has_predecessor (stated_dag c)) <= followers c.
Proof.
  apply sum_le. intros v _. destruct (has_predecessor (stated_dag c) v) eqn:H; simpl; [|lia].
  unfold has_predecessor in H. apply existsb_exists in H. destruct H as (u & _ & E).
  unfold edge, stated_dag, stated_edge, listed_edge in E. apply andb_true_iff in E. destruct E as (_ & E).
  destruct (nth v (preds c) []); [discriminate|simpl; lia].
Qed.

(** ** The inequalities *)

Section set.
Variables (m : nat) (due_no_later : bool) (claims : list claim).

Definition work_ofN (k h : nat) (vertices : nat -> bool) (p : nat) (r : N) : N :=
  let c := claim_of claims h in
  window_workN (if due_no_later then Some (relative_deadline (claim_of claims k), least_deadline c)
                else None)
    (weightN c (togetherN c) (fun v => vertices v && negb (existsb (Nat.eqb v) (wait_list c))))
    (N.of_nat p) (bound c) (minimum_period c) r.

Definition full_workN (h : nat) (r : N) : N :=
  let c := claim_of claims h in
  ((r + (minimum_period c - 1)) / minimum_period c
   * weightN c (togetherN c) (fun v => negb (existsb (Nat.eqb v) (wait_list c))))%N.

Definition cores_usedN (j h : nat) : nat := Nat.min (m - j) (width (claim_of claims h)).

Definition whole_workN (k j h : nat) (r : N) : N := work_ofN k h (fun _ => true) (cores_usedN j h) r.

Definition clipped_workN (k j h : nat) (r x : N) : N :=
  let c := claim_of claims h in
  let all := (N.of_nat (cores_usedN j h) * x)%N in
  N.min (whole_workN k j h r)
    (N.min all
       (sumN (parts c) (fun i => N.min (work_ofN k h (fun v => label (part_of c) v =? i) 1 r) x)
        + N.min (work_ofN k h (fun v => parts c <=? label (part_of c) v) (cores_usedN j h) r) all)).

Definition rising_workN (k j h : nat) (r x : N) : N :=
  let c := claim_of claims h in
  let p := N.of_nat (cores_usedN j h) in
  let all := (p * x)%N in
  let chain i := work_ofN k h (fun v => label (part_of c) v =? i) 1 r in
  let rest := work_ofN k h (fun v => parts c <=? label (part_of c) v) (cores_usedN j h) r in
  let sums := (sumN (parts c) (fun i => N.min (chain i) x) + N.min rest all)%N in
  let chains := (sumN (parts c) (fun i => if (x <? chain i)%N then 1%N else 0%N) + (if (all <? rest)%N then p else 0))%N in
  if (whole_workN k j h r <=? N.min all sums)%N then 0%N
  else if (all <? sums)%N then p else if (sums <? all)%N then chains else N.min p chains.

Definition sum_over_othersN (k : nat) (g : nat -> N) : N :=
  sumN (length claims) (fun h =>
    if negb (h =? k) && outranks (stated_policy due_no_later claims) h k then g h else 0%N).

Definition blocksN (k h : nat) : bool :=
  negb (h =? k) && (due_no_later || negb (outranks (stated_policy due_no_later claims) h k))
  && keeping (claim_of claims h).

Definition largest_blockingN (k q : nat) (level : N) : N :=
  (N.of_nat q * level + sumN (length claims) (fun h => if blocksN k h
     then sumN (vertices (claim_of claims h)) (fun v =>
       if existsb (Nat.eqb v) (wait_list (claim_of claims h)) then 0 else wcetN (claim_of claims h) v - level)
     else 0))%N.

Definition blockingN (k j again : nat) : N :=
  (largest_blockingN k (m - j) (first_level (claim_of claims k))
   + N.of_nat again * largest_blockingN k (Nat.min (m - j) (m - 1)) (later_level (claim_of claims k)))%N.

Definition no_blocking (k : nat) : bool := forallb (fun h => negb (blocksN k h)) (seq 0 (length claims)).

Definition outsideN (c : claim) (j : nat) (f : nat -> nat) (v : nat) : bool :=
  negb (existsb (Nat.eqb v) (wait_list c)) && (j <=? f v).

Definition on_pathN (c : claim) (j : nat) (f : nat -> nat) (every later : N) (v : nat) : N :=
  (N.of_nat (m - j) * togetherN c v - (if outsideN c j f v then togetherN c v else 0)
   + (if existsb (Nat.eqb v) (wait_list c) then 0
      else if after_wait (stated_dag c) (fun u => negb (existsb (Nat.eqb u) (wait_list c))) v then every else later))%N.

(** No path of a [piece] of the DAG is heavier. *)
Definition most_of (c : claim) (piece : nat -> bool) (w : nat -> N) : N :=
  fold_right N.max 0%N (levels c (fun v => if piece v then w v else 0%N)).
Definition most_ok (c : claim) (piece : nat -> bool) (w : nat -> N) : bool :=
  let w' v := if piece v then w v else 0%N in levels_ok c w' (levels c w') (most_of c piece w).

Definition path_ok (k : nat) (piece : nat -> bool) (j : nat) (f : nat -> nat) (full : nat -> bool) (level0 level1 r x : N)
    : bool :=
  let c := claim_of claims k in
  let every := largest_blockingN k m level0 in
  let later := largest_blockingN k (m - 1) level1 in
  let w := on_pathN c j f every later in
  most_ok c piece w &&
  (weightN c (togetherN c) (outsideN c j f) + (every - later)
   + sum_over_othersN k (fun h => if full h then full_workN h r else whole_workN k j h r)
   + N.of_nat (m - j) * x + most_of c piece w <=? N.of_nat (m - j) * r)%N.

(** On one core: whether the jobs of DAG h count in full, from where none is left. *)
Definition in_fullN (k h : nat) : bool :=
  let o := outranks (stated_policy due_no_later claims) in
  negb (h =? k) && o h k && negb (has_some (wait_list (claim_of claims h))) &&
  forallb (fun g => (g =? h) || negb (o g h) || negb (g =? k) && o g k) (seq 0 (length claims)).

Definition window_ok (k j : nat) (f : nat -> nat) : bool :=
  (m =? 1) && negb due_no_later && forallb (fun c => negb (keeping c)) claims &&
  (0 <? weightN (claim_of claims k) (togetherN (claim_of claims k)) (outsideN (claim_of claims k) j f))%N.

Definition delaysN (h k : nat) : bool :=
  negb (h =? k) && (outranks (stated_policy due_no_later claims) h k || keeping (claim_of claims h)).

Definition fits_ok (k : nat) : bool :=
  (match cover (claim_of claims k) with Some _ => true | None => false end) &&
  forallb (fun h => negb (delaysN h k) || claimed (claim_of claims h)) (seq 0 (length claims)) &&
  (width (claim_of claims k) + sum (length claims) (fun h => if delaysN h k then width (claim_of claims h) else 0) <=? m).

Definition part_ok (k : nat) (piece : nat -> bool) (j : nat) (f : nat -> nat) (level0 level1 r x : N) : bool :=
  let c := claim_of claims k in
  all_vertices c (fun v => negb (piece v) || forallb piece (nth v (preds c) [])) &&
  (path_ok k piece j f (fun _ => false) level0 level1 r x ||
   window_ok k j f && path_ok k piece j f (in_fullN k) level0 level1 r x ||
   costless c && (x =? 0)%N && fits_ok k && most_ok c piece (togetherN c) && (most_of c piece (togetherN c) + x <=? r)%N).

Definition inequality_ok (k : nat) (len : N) : bool :=
  let c := claim_of claims k in
  let j := free_chains c in
  let left := left_overN c j (label (chain_of c)) in
  let r := bound c in
  let room := (N.of_nat (m - j) * (r - len))%N in
  let blocked := blockingN k j (followers c) in
  let whole := (sum_over_othersN k (fun h => whole_workN k j h r) + N.of_nat (m - j) * loss c)%N in
  (no_blocking k || negb (has_some (wait_list c))) &&
  ((left + blocked + whole <=? room)%N ||
   (let clipped := sum_over_othersN k (fun h => clipped_workN k j h r (r - len)) in
    let lost := N.of_nat (m - j) * loss c in
    (N.max 1 left + blocked + clipped + lost <=? room) ||
    (left + blocked + clipped + lost <=? room) &&
    (sum_over_othersN k (fun h => rising_workN k j h r (r - len)) <? N.of_nat (m - j)))%N) ||
  part_ok k (fun _ => true) j (label (chain_of c)) (first_level c) (later_level c) r (loss c).

Definition outrankers_ok (k : nat) : bool :=
  forallb (fun h => (h =? k) || negb (outranks (stated_policy due_no_later claims) h k)
                    || claimed (claim_of claims h)) (seq 0 (length claims)).

(** Refused are statements that no run obeys, for all would be true of it: WCETs and periods of 0; a policy by which
    neither of two DAGs may outrank the other, or under EDF not both; a least deadline beyond the DAG's. *)
Definition wcets_ok (c : claim) : bool :=
  negb (known_wcets c) || all_vertices c (fun v => existsb (Nat.eqb v) (wait_list c) || (0 <? wcetN c v)%N).

Definition policy_ok (k : nat) : bool :=
  let o := outranks (stated_policy due_no_later claims) in
  forallb (fun h => (h =? k) || (if due_no_later then o h k else o h k || o k h)) (seq 0 (length claims)) &&
  (negb due_no_later || (least_deadline (claim_of claims k) <=? relative_deadline (claim_of claims k))%N).

Definition blockers_ok (k : nat) : bool :=
  forallb (fun h => negb (blocksN k h) || known_wcets (claim_of claims h)) (seq 0 (length claims)).

Definition claim_ok (k : nat) : bool :=
  let c := claim_of claims k in
  let anc := ancestors c in
  let lv := levels c (togetherN c) in
  let len := fold_right N.max 0%N lv in
  wcets_ok c && (0 <? minimum_period c)%N && policy_ok k && edges_ok c &&
  (negb (claimed c) ||
   known_wcets c && blockers_ok k && edges_ok c && ancestors_ok c anc && heads_ok c && levels_ok c (togetherN c) lv len && width_ok c anc m &&
   chains_ok c anc (part_of c) (parts c) && chains_ok c anc (chain_of c) (S (free_chains c)) &&
   (free_chains c <? m) && (len <=? bound c)%N && (bound c <=? minimum_period c)%N &&
   outrankers_ok k && (no_blocking k || keeping c) && inequality_ok k len).

Definition check : bool := forallb claim_ok (seq 0 (length claims)).

Let tau := stated_tasks claims.
Let pol := stated_policy due_no_later claims.
Let R k := N.to_nat (bound (claim_of claims k)).
Let bd k := claimed (claim_of claims k).
Let ls k := N.to_nat (loss (claim_of claims k)).
Let wd k := width (claim_of claims k).
Let ps k := parts (claim_of claims k).
Let pt k := label (part_of (claim_of claims k)).

Lemma work_ofN_ok k h vertices p r :
  N.to_nat (work_ofN k h vertices p r) = work_of tau pol R k h vertices p (N.to_nat r).
Proof.
  unfold work_ofN, work_of. cbv zeta. rewrite window_workN_ok, weightN_ok, Nat2N.id.
  unfold pol. simpl. destruct due_no_later; reflexivity.
Qed.

Lemma full_workN_ok h r : N.to_nat (full_workN h r) = full_work tau h (N.to_nat r).
Proof.
  unfold full_workN, full_work, up. cbv zeta. to_nat. rewrite weightN_ok. reflexivity.
Qed.

Lemma clipped_workN_ok k j h r x :
  N.to_nat (clipped_workN k j h r x)
  = clipped_work m tau pol R wd ps pt k j h (N.to_nat r) (N.to_nat x).
Proof.
  unfold clipped_workN, clipped_work, clipped, whole_workN, whole_work. cbv zeta.
  rewrite !N2Nat.inj_min, N2Nat.inj_add, !N2Nat.inj_min, N2Nat.inj_mul, Nat2N.id, !work_ofN_ok.
  f_equal. f_equal. f_equal. apply sumN_ok. intros i _.
  rewrite N2Nat.inj_min, work_ofN_ok. reflexivity.
Qed.

Lemma ltb_to_nat a b : (N.to_nat a <? N.to_nat b) = (a <? b)%N.
Proof. destruct (N.ltb_spec a b), (Nat.ltb_spec (N.to_nat a) (N.to_nat b)); auto; lia. Qed.

Lemma rising_workN_ok k j h r x :
  N.to_nat (rising_workN k j h r x)
  = rising_work m tau pol R wd ps pt k j h (N.to_nat r) (N.to_nat x).
Proof.
  unfold rising_work, rise. cbv zeta. rewrite <- !work_ofN_ok. fold (cores_used m wd j h).
  change (whole_work m tau pol R wd k j h (N.to_nat r)) with
    (work_of tau pol R k h (fun _ => true) (cores_used m wd j h) (N.to_nat r)). rewrite <- work_ofN_ok.
  rewrite <- (sumN_ok (ps h) (fun i => N.min (work_ofN k h (fun v => pt h v =? i)%nat 1 r) x))
    by (intros i _; rewrite N2Nat.inj_min, work_ofN_ok; reflexivity).
  rewrite <- (sumN_ok (ps h) (fun i => if (x <? work_ofN k h (fun v => pt h v =? i)%nat 1 r)%N then 1%N else 0%N))
    by (intros i _; rewrite <- work_ofN_ok, ltb_to_nat; destruct (x <? _)%N; reflexivity).
  unfold rising_workN, whole_workN. cbv zeta. fold (ps h) (pt h). change (cores_usedN j h) with (cores_used m wd j h).
  set (p := cores_used m wd j h).
  replace (p * N.to_nat x) with (N.to_nat (N.of_nat p * x)) by lia.
  rewrite <- N2Nat.inj_min, <- N2Nat.inj_add, <- N2Nat.inj_min, !ltb_to_nat.
  set (W := work_ofN k h (fun _ => true) p r). set (sums := (sumN _ _ + N.min _ _)%N).
  replace (N.to_nat W <=? N.to_nat (N.min (N.of_nat p * x) sums)) with (W <=? N.min (N.of_nat p * x) sums)%N
    by (destruct (N.leb_spec W (N.min (N.of_nat p * x) sums)),
          (Nat.leb_spec (N.to_nat W) (N.to_nat (N.min (N.of_nat p * x) sums))); auto; lia).
  repeat match goal with |- context [if ?b then _ else _] => destruct b end; lia.
Qed.

Lemma sum_over_othersN_ok k f g :
  (forall h, N.to_nat (f h) = g h) ->
  N.to_nat (sum_over_othersN k f) = sum_over_others (length claims) pol k g.
Proof.
  intros H. apply sumN_ok. intros h _. unfold pol.
  destruct (negb (h =? k) && outranks (stated_policy due_no_later claims) h k); auto.
Qed.

Lemma blocksN_ok k h v :
  blocks tau pol k h v = blocksN k h && negb (existsb (Nat.eqb v) (wait_list (claim_of claims h))).
Proof.
  unfold blocks, may_block, blocksN, on_core. simpl.
  rewrite <- !andb_assoc. f_equal. f_equal. apply andb_comm.
Qed.

Lemma largest_blockingN_ok k q level :
  N.to_nat (largest_blockingN k q level)
  = largest_blocking (length claims) tau pol k q (N.to_nat level).
Proof.
  unfold largest_blockingN, largest_blocking. rewrite N2Nat.inj_add, N2Nat.inj_mul, Nat2N.id. f_equal.
  apply sumN_ok. intros h _.
  assert (E : forall v, (if blocks tau pol k h v then wcet (tau h) v else 0)
    = if blocksN k h then if existsb (Nat.eqb v) (wait_list (claim_of claims h)) then 0
                          else N.to_nat (wcetN (claim_of claims h) v) else 0).
  { intros v. rewrite blocksN_ok. destruct (blocksN k h); simpl; auto.
    destruct (existsb (Nat.eqb v) (wait_list (claim_of claims h))); reflexivity. }
  rewrite (sum_ext _ _ _ (fun v _ => f_equal (fun x => x - N.to_nat level) (E v))).
  destruct (blocksN k h).
  - apply sumN_ok. intros v _. destruct (existsb (Nat.eqb v) (wait_list (claim_of claims h))); [reflexivity|].
    apply N2Nat.inj_sub.
  - symmetry. apply sum_zero. auto.
Qed.

Lemma blockingN_ok k j again :
  N.to_nat (blockingN k j again)
  = blocking (length claims) m tau pol k j again
      (N.to_nat (first_level (claim_of claims k))) (N.to_nat (later_level (claim_of claims k))).
Proof.
  unfold blockingN, blocking.
  rewrite N2Nat.inj_add, N2Nat.inj_mul, Nat2N.id, !largest_blockingN_ok. reflexivity.
Qed.

Lemma no_blocking_ok k : no_blocking k = true -> unblocked (length claims) tau pol k.
Proof.
  unfold no_blocking. rewrite forallb_forall. intros B h v Hh _.
  specialize (B h ltac:(apply in_seq; lia)). apply negb_true_iff in B. rewrite blocksN_ok, B. reflexivity.
Qed.

Lemma on_pathN_ok k j f every later level0 level1 v :
  let c := claim_of claims k in
  N.to_nat every = largest_blocking (length claims) tau pol k m level0 ->
  N.to_nat later = largest_blocking (length claims) tau pol k (m - 1) level1 ->
  N.to_nat (on_pathN c j f every later v) = on_path (length claims) m tau pol k j f level0 level1 v.
Proof.
  intros c E1 E2. unfold on_pathN, on_path. rewrite <- E1, <- E2. to_nat. rewrite Nat2N.id. f_equal.
  - f_equal. unfold outsideN, outside. fold c. change (on_core tau k v) with (negb (existsb (Nat.eqb v) (wait_list c))).
    destruct (negb (existsb (Nat.eqb v) (wait_list c)) && (j <=? f v)); reflexivity.
  - change (on_core tau k) with (fun v => negb (existsb (Nat.eqb v) (wait_list c))). cbv beta.
    change (graph (tau k)) with (stated_dag c). destruct (existsb (Nat.eqb v) (wait_list c)); [reflexivity|]. simpl negb.
    destruct (after_wait (stated_dag c) (fun u => negb (existsb (Nat.eqb u) (wait_list c))) v); reflexivity.
Qed.

Lemma most_ok_sound c piece w : edges_ok c = true -> most_ok c piece w = true ->
  no_path_longer (stated_dag c) (fun v => if piece v then N.to_nat (w v) else 0) (N.to_nat (most_of c piece w)).
Proof.
  intros E M l P. apply Nat.le_trans with (2 := levels_bound c _ _ _ E M l P). apply Nat.eq_le_incl.
  unfold path_length. f_equal. apply map_ext. intros v. destruct (piece v); reflexivity.
Qed.

Lemma part_ok_sound k piece j f level0 level1 r x : let c := claim_of claims k in
  edges_ok c = true -> ancestors_ok c (ancestors c) = true -> width_ok c (ancestors c) m = true ->
  j < m -> disjoint_chains (stated_dag c) j f -> (forall v, v < vertices c -> f (head_of c v) = f v) ->
  part_ok k piece j f level0 level1 r x = true ->
  part_inequality (length claims) m tau pol bd R wd k piece (N.to_nat r) (N.to_nat x).
Proof.
  intros c E A W Hj D Hf I. unfold part_ok in I. cbv zeta in I. fold c in I.
  apply andb_true_iff in I. destruct I as (Cl & I). split.
  { intros u v Ed Pv. simpl in Ed. pose proof (stated_dag c).(edges_lead_up) u v Ed as Up. simpl in Up.
    pose proof (all_vertices_true c _ Cl v ltac:(lia)) as Q. cbv beta in Q. rewrite Pv in Q. simpl in Q.
    rewrite forallb_forall in Q. apply Q. unfold stated_edge, listed_edge in Ed. apply andb_true_iff in Ed.
    destruct Ed as (_ & Ed). apply existsb_exists in Ed. destruct Ed as (y & Hy & Ey). apply Nat.eqb_eq in Ey. subst. exact Hy. }
  apply orb_true_iff in I. destruct I as [I|I].
  - assert (Any : exists full, path_ok k piece j f full level0 level1 r x = true /\ forall h, h < length claims -> full h = true ->
      window_applies (length claims) m tau pol k (weight (graph (tau k)) (together (tau k)) (outside tau k j f)) h).
    { apply orb_true_iff in I. destruct I as [I|I]; [exists (fun _ => false); split; [exact I|discriminate]|].
      apply andb_true_iff in I. destruct I as (Wn & I). exists (in_fullN k). split; [exact I|]. intros h Hh Fh.
      unfold window_ok in Wn. rewrite !andb_true_iff, Nat.eqb_eq, negb_true_iff, N.ltb_lt in Wn.
      destruct Wn as (((M1 & Rank) & Keep) & Pos). rewrite forallb_forall in Keep.
      unfold in_fullN in Fh. rewrite !andb_true_iff in Fh. destruct Fh as (((Ne & Ou) & Wt) & Closed).
      rewrite forallb_forall in Closed. split; [exact M1|]. split; [exact Rank|]. split; [|split].
      - change (0 < weight (stated_dag c) (fun v => N.to_nat (togetherN c v)) (outsideN c j f)). rewrite <- weightN_ok. fold c in Pos. lia.
      - intros g w Hg. change (keeping (claim_of claims g) = false). apply negb_true_iff, Keep, nth_In, Hg.
      - split; [unfold above; rewrite Ne; exact Ou|]. split.
        + intros w _. simpl. destruct (wait_list (claim_of claims h)); [reflexivity|discriminate].
        + intros g Hg Ng Og. specialize (Closed g ltac:(apply in_seq; lia)). apply Nat.eqb_neq in Ng. rewrite Ng in Closed.
          change (outranks (stated_policy due_no_later claims) g h = true) in Og. rewrite Og in Closed. exact Closed. }
    destruct Any as (full & Ok & Full). clear I. rename Ok into I.
    left. unfold path_ok in I. cbv zeta in I. fold c in I. apply andb_true_iff in I. destruct I as (M & I).
    set (every := largest_blockingN k m level0) in *. set (later := largest_blockingN k (m - 1) level1) in *.
    exists j, f, (N.to_nat level0), (N.to_nat level1), (N.to_nat (most_of c piece (on_pathN c j f every later))), full. cbv zeta.
    split; [exact Hj|]. split; [exact D|]. split; [exact Hf|]. split; [|split; [exact Full|]].
    + intros l P. apply Nat.le_trans with (2 := most_ok_sound c piece _ E M l P). apply Nat.eq_le_incl.
      unfold path_length. f_equal. apply map_ext. intros v. destruct (piece v); [|reflexivity].
      symmetry. apply on_pathN_ok; apply largest_blockingN_ok.
    + apply N.leb_le in I. rewrite <- !largest_blockingN_ok.
      change (weight (graph (tau k)) (together (tau k)) (outside tau k j f))
        with (weight (stated_dag c) (fun v => N.to_nat (togetherN c v)) (outsideN c j f)).
      rewrite <- (sum_over_othersN_ok k (fun h => if full h then full_workN h r else whole_workN k j h r))
        by (intros h; destruct (full h); [apply full_workN_ok|apply work_ofN_ok]).
      rewrite <- weightN_ok, <- (Nat2N.id (m - j)). fold every later.
      rewrite <- N2Nat.inj_sub, <- !N2Nat.inj_mul, <- !N2Nat.inj_add. lia.
  - right. rewrite !andb_true_iff in I. destruct I as (((_ & F) & M) & I). split.
    + unfold fits_ok in F. fold c in F. rewrite !andb_true_iff in F. destruct F as ((Co & Bd) & Room).
      destruct (cover c) as [l|] eqn:Ec; [|discriminate].
      assert (De : forall h, delays tau pol h k = true -> delaysN h k = true).
      { intros h H. unfold delays in H. unfold delaysN. apply andb_true_iff in H. destruct H as (-> & H).
        apply orb_true_iff. apply orb_true_iff in H. destruct H as [H|H]; [left; exact H|right].
        apply existsb_exists in H. destruct H as (w & _ & H). rewrite blocksN_ok in H. unfold blocksN in H.
        rewrite !andb_true_iff in H. tauto. }
      split; [exists (label l); apply (cover_ok_sound c (ancestors c) m l); auto|]. split.
      * intros h Hh H. apply De in H. rewrite forallb_forall in Bd. specialize (Bd h ltac:(apply in_seq; lia)).
        rewrite H in Bd. exact Bd.
      * apply Nat.leb_le in Room. apply Nat.le_trans with (2 := Room). apply Nat.add_le_mono_l. apply sum_le. intros h _.
        destruct (delays tau pol h k) eqn:H; [rewrite (De h H)|]; unfold wd; lia.
    + exists (N.to_nat (most_of c piece (togetherN c))). split; [apply (most_ok_sound c piece (togetherN c) E M)|].
      apply N.leb_le in I. lia.
Qed.

Lemma claim_ok_shown k :
  claim_ok k = true -> claimed (claim_of claims k) = true ->
  shown (length claims) m tau pol bd R ls wd ps pt k.
Proof.
  unfold claim_ok. cbv zeta. intros Ok Cl. rewrite Cl in Ok. simpl negb in Ok. rewrite orb_false_l in Ok.
  revert Ok.
  set (c := claim_of claims k). set (len := fold_right N.max 0%N (levels c (togetherN c))).
  rewrite !andb_true_iff.
  intros (_ & ((((((((((((((Kn & Bk) & E) & A) & Hd) & L) & W) & P) & F) & Hj) & HL) & HR) & O) & B) & I)).
  apply Nat.ltb_lt in Hj. apply N.leb_le in HL, HR.
  split; [exact Kn|]. split; [exact Cl|]. split.
  { intros h v Hh _ Bl. rewrite blocksN_ok in Bl. apply andb_true_iff in Bl. destruct Bl as (Bl & _).
    unfold blockers_ok in Bk. rewrite forallb_forall in Bk. specialize (Bk h ltac:(apply in_seq; lia)).
    rewrite Bl in Bk. exact Bk. }
  split; [apply (width_ok_sound c (ancestors c)); auto|].
  split; [apply (chains_ok_sound c (ancestors c)); auto|].
  destruct (heads_ok_sound c E Hd) as (Heads & Same). split; [exact Heads|]. split.
  { intros v Hv. destruct (Same v Hv) as (On & Pt & _). split; [|exact Pt]. unfold on_core. simpl. fold c. rewrite On. reflexivity. }
  split.
  { intros h Hh N Ou. unfold outrankers_ok in O. rewrite forallb_forall in O.
    specialize (O h ltac:(apply in_seq; lia)). apply Nat.eqb_neq in N. rewrite N in O.
    change (outranks (stated_policy due_no_later claims) h k = true) in Ou. rewrite Ou in O. exact O. }
  split.
  { apply orb_true_iff in B. destruct B as [B|B]; [left; apply no_blocking_ok, B|right; intros v _ _; exact B]. }
  set (j := free_chains c) in *.
  set (level0 := N.to_nat (first_level c)). set (level1 := N.to_nat (later_level c)).
  assert (Dis : disjoint_chains (stated_dag c) j (label (chain_of c))).
  { intros u v H Hv Eq Le. apply (chains_ok_sound c (ancestors c) (chain_of c) (S (free_chains c))); auto. fold j. lia. }
  exists j, (label (chain_of c)), (N.to_nat len), (followers c), level0, level1.
  split; [auto|]. split; [apply (levels_bound c (togetherN c) (levels c (togetherN c)) len E L)|].
  split; [exact Dis|].
  split; [intros v Hv; apply (Same v Hv)|].
  split; [unfold R, tau, stated_tasks, stated_task, period; fold c; lia|].
  cbv zeta.
  unfold inequality_ok in I. cbv zeta in I. fold c j in I. apply orb_true_iff in I.
  destruct I as [I|I]; [left|right; apply (part_ok_sound k (fun _ => true) j (label (chain_of c)) (first_level c) (later_level c)); auto;
                             intros v Hv; apply (Same v Hv)].
  unfold first_inequality, second_inequality.
  change (R k) with (N.to_nat (bound c)). change (ls k) with (N.to_nat (loss c)).
  change (graph (tau k)) with (stated_dag c). change (together (tau k)) with (fun v => N.to_nat (togetherN c v)).
  rewrite <- left_overN_ok. unfold level0, level1. rewrite <- blockingN_ok.
  rewrite <- (sum_over_othersN_ok k (fun h => whole_workN k j h (bound c))) by (intros; apply work_ofN_ok).
  rewrite <- (sum_over_othersN_ok k (fun h => clipped_workN k j h (bound c) (bound c - len)))
    by (intros; rewrite clipped_workN_ok, N2Nat.inj_sub; reflexivity).
  rewrite <- N2Nat.inj_sub.
  rewrite <- (sum_over_othersN_ok k (fun h => rising_workN k j h (bound c) (bound c - len)))
    by (intros; apply rising_workN_ok).
  set (clipped := sum_over_othersN k (fun h => clipped_workN k j h (bound c) (bound c - len))) in *.
  set (rising := sum_over_othersN k (fun h => rising_workN k j h (bound c) (bound c - len))) in *.
  change (Nat.max 1) with (Nat.max (N.to_nat 1)). rewrite <- (Nat2N.id (m - j)).
  apply andb_true_iff in I. destruct I as (U & I). split; [|split].
  - apply orb_true_iff in U. destruct U as [U|U]; [left; apply no_blocking_ok, U|right].
    intros v _. simpl. fold c. destruct (wait_list c); [reflexivity|discriminate].
  - apply followers_ok.
  - rewrite <- N2Nat.inj_max, <- !N2Nat.inj_mul, <- !N2Nat.inj_add.
    rewrite !orb_true_iff, andb_true_iff, N.ltb_lt, !N.leb_le in I. destruct I as [I|[I|(I & Up)]]; [left|right; left|right; right]; lia.
Qed.

Lemma check_each : check = true -> forall k, k < length claims -> claim_ok k = true.
Proof.
  unfold check. rewrite forallb_forall. intros Ck k Hk. apply Ck. apply in_seq. lia.
Qed.

(** *What [check] accepts is true: in every run that obeys the rules, each job of each DAG with a claim is complete
    within its claimed bound.*  The rules are those of [global_run], for the stated DAGs and policy.  How much may be
    lost to the platform is taken from the claims. *)
Theorem check_sound : check = true ->
  forall s,
  global_run (length claims) m (stated_tasks claims) (stated_policy due_no_later claims) s ->
  (forall k a, k < length claims -> claimed (claim_of claims k) = true ->
     count (N.to_nat (bound (claim_of claims k))) (fun t => lost s (a + t))
     <= N.to_nat (loss (claim_of claims k))) ->
  forall k n, k < length claims -> claimed (claim_of claims k) = true ->
    job_complete (stated_tasks claims) s (release s k n + N.to_nat (bound (claim_of claims k))) k n.
Proof.
  intros Ck s Rules Losses.
  apply (set_bounds (length claims) m tau pol s bd R ls wd ps pt Rules Losses).
  intros k Hk. apply claim_ok_shown, check_each; auto.
Qed.

End set.



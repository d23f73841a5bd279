(** * The checker refuses only what is wrong

    A witness that is well formed, and whose endless table is right, is accepted. With CheckerProof.v: on well-formed witnesses the
    checker decides whether the table is right. *)

From Coq Require Import ZArith List Bool Lia FMapPositive.
From Table Require Import Model Sustainable Checker CheckerProof.
Import ListNotations.
Open Scope Z_scope.

Section Complete.
Variable w : witness.
Let H := w_lap w.
Let tb := table_of w.
Let get (l : list entry) (i : nat) := nth i l no_entry.
Let dag_at (d : nat) := nth d (w_dags w) no_dag.

(** The numbers mean what they should; bounds and np; each instance at exactly one place. *)
Record well_formed : Prop := {
  a_lap : 0 < H;
  dags : forall d, In d (w_dags w) ->
    0 < d_period d /\ 0 <= d_offset d /\ H mod d_period d = 0 /\ forall v, In v (d_subtasks d) -> 0 <= s_wcet v;
  no_empty_list : forall l, In l (w_lists w) -> l <> [];
  numbers : forall p, (fst p < cores tb)%nat ->
    (e_dag (entry_at w p) < length (w_dags w))%nat /\
    (e_sub (entry_at w p) < length (d_subtasks (dag_of w (entry_at w p))))%nat;
  edges : forall d v x, In d (w_dags w) -> In v (d_subtasks d) -> In x (s_preds v) ->
    (fst x < length (d_subtasks d))%nat;
  bounds : forall p, (fst p < cores tb)%nat -> finish tb p <= release tb p + s_bound (subtask_of w (entry_at w p));
  alone : forall k n, (k < cores tb)%nat -> s_alone (subtask_of w (entry_at w (k, n))) = true ->
    depth tb (k, S n) <= depth tb (k, n);
  everywhere : forall d job v, (d < length (w_dags w))%nat -> (v < length (d_subtasks (dag_at d)))%nat -> 0 <= job ->
    exists p, (fst p < cores tb)%nat /\ instance_at w p = (d, job, v);
  once : forall p p', (fst p < cores tb)%nat -> (fst p' < cores tb)%nat -> instance_at w p = instance_at w p' -> p = p'
}.

Hypothesis W : well_formed.
Hypothesis R : right tb.

(** ** One core *)

Lemma nested_complete : forall d rest acc n, (n < length rest)%nat ->
  (forall j, (j < n)%nat -> d < e_depth (get rest j)) -> e_depth (get rest n) <= d ->
  nested w d acc rest = Some (acc + sum (fun j => cost w (get rest j)) 0 n, get rest n).
Proof.
  intros d rest; induction rest as [|x rest IH]; simpl; intros acc n Hn Hj Hd; [lia|].
  destruct n as [|n].
  - apply Z.leb_le in Hd. change (get (x :: rest) 0) with x in *. rewrite Hd. simpl. do 2 f_equal. lia.
  - pose proof (Hj O ltac:(lia)) as H0. change (get (x :: rest) 0) with x in H0. apply Z.leb_gt in H0. rewrite H0.
    rewrite (IH (acc + cost w x) n); [|lia| |exact Hd].
    + change (get (x :: rest) (S n)) with (get rest n). do 2 f_equal. simpl. rewrite <- Z.add_assoc. do 2 f_equal.
      apply sum_ext; intros; auto.
    + intros j Hlt. apply (Hj (S j)); lia.
Qed.

Lemma core_ok_complete : forall n l, (forall i, (i < n)%nat -> family_in w l i) -> core_ok w n l = true.
Proof.
  induction n; intros l F; auto.
  destruct (F O ltac:(lia)) as (F1 & F2 & (m & F3 & F4 & F5 & F6 & F7) & F8).
  destruct l as [|x [|y rest]]; simpl in F1; [lia|lia|].
  cbn [core_ok]. apply andb_true_intro. split.
  - rewrite (nested_complete (e_depth x) (y :: rest) (cost w x) m).
    + rewrite !andb_true_iff, !Z.leb_le, orb_true_iff, negb_true_iff, Z.leb_le. repeat split; auto.
      * replace (sum (fun j => cost w (get (y :: rest) j)) 0 m)
          with (sum (fun j => cost w (nth j (x :: y :: rest) no_entry)) 1 m) by (apply sum_ext; intros; auto).
        change (nth 0 (x :: y :: rest) no_entry) with x in F7. lia.
      * destruct (s_alone (subtask_of w x)) eqn:A; [right; apply F8; exact A|left; auto].
    + simpl in *. lia.
    + intros j Hj. apply (F4 (S j)). lia.
    + exact F5.
  - apply IHn. intros i Hi. destruct (F (S i) ltac:(lia)) as (G1 & G2 & (a & G3 & G4 & G5 & G6 & G7) & G8).
    split; [simpl in *; lia|]. split; [exact G2|]. split; [|exact G8].
    exists a. split; [simpl in *; lia|]. split; [|split; [exact G5|split; [exact G6|]]].
    + intros j Hj. apply (G4 (S j)). lia.
    + replace (sum (fun j => cost w (nth j (y :: rest) no_entry)) (S i) a)
        with (sum (fun j => cost w (nth j (x :: y :: rest) no_entry)) (S (S i)) a) by (apply sum_ext; intros; auto).
      exact G7.
Qed.

Lemma not_empty : forall k, (k < length (w_lists w))%nat -> length (list_of w k) <> O.
Proof.
  intros k Hk. pose proof (no_empty_list W (list_of w k) ltac:(apply nth_In; auto)) as Hn.
  destruct (list_of w k); simpl; [congruence|lia].
Qed.

Lemma list_ok_complete : forall k, (k < length (w_lists w))%nat -> list_ok w (list_of w k) = true.
Proof.
  intros k Hk. pose proof (not_empty k Hk) as Hlen. set (l := list_of w k) in *.
  assert (L : forall j, (j < length l + length l)%nat -> let e := nth j (l ++ map (later H) l) no_entry in
    e_start e = start tb (k, j) /\ e_finish e = finish tb (k, j) /\ e_depth e = depth tb (k, j) /\
    cost w e = wcet tb (k, j) /\ subtask_of w e = subtask_of w (entry_at w (k, j))).
  { intros j Hj. cbv zeta. unfold H. rewrite (two_laps w l j Hj). repeat split. }
  assert (F : forall i, (i < length l)%nat -> family_in w (l ++ map (later H) l) i).
  { intros i Hi. destruct (family tb R k i Hk) as (n & (Hin & Hfin) & Hsum).
    assert (Same : depth tb (k, (i + length l)%nat) = depth tb (k, i)).
    { simpl. unfold entry_at; simpl. fold l. replace (i + length l)%nat with (i + 1 * length l)%nat by lia.
      rewrite Nat.mod_add by auto. reflexivity. }
    assert (Hn : (S i + n <= i + length l)%nat).
    { destruct Hin as [[Hin _]|[_ ->]]; [|lia].
      destruct (Nat.le_gt_cases (S i + n) (i + length l)) as [|Hgt]; auto.
      specialize (Hin (i + length l)%nat ltac:(lia)). lia. }
    assert (Hd : (forall j, (i < j < S i + n)%nat -> depth tb (k, i) < depth tb (k, j)) /\
                 depth tb (k, (S i + n)%nat) <= depth tb (k, i)).
    { destruct Hin as [?|[Hp ->]]; auto. split; [intros; lia|]. rewrite (Hp (S i + 0)%nat i). lia. }
    destruct Hd as [Hd1 Hd2].
    destruct (L i ltac:(lia)) as (Li1 & Li2 & Li3 & Li4 & Li5). destruct (L (S i) ltac:(lia)) as (Ls1 & _ & Ls3 & _).
    unfold family_in. rewrite app_length, map_length. split; [lia|]. split.
    - rewrite Li1, Ls1. apply (sorted tb R); auto.
    - split.
      + exists n. destruct (L (S i + n)%nat ltac:(lia)) as (Ln1 & _ & Ln3 & _).
        split; [lia|]. rewrite Li1, Li2, Li3, Li4, Ln1, Ln3. split; [|split; [auto|split; [auto|]]].
        * intros j Hj. destruct (L j ltac:(lia)) as (_ & _ & Lj & _). rewrite Lj. auto.
        * rewrite work_is_sum in Hsum.
          replace (sum (fun j => cost w (nth j (l ++ map (later H) l) no_entry)) (S i) n)
            with (sum (fun j => wcet tb (k, j)) (S i) n); [auto|].
          apply sum_ext. intros a Ha. symmetry. apply (L (S i + a)%nat). lia.
      + intros Ha. rewrite Ls3, Li3. apply (alone W k i Hk). rewrite <- Li5. exact Ha. }
  unfold list_ok. fold H. destruct l as [|x l'] eqn:E; [simpl in Hlen; congruence|]. rewrite <- E in *.
  rewrite andb_true_iff, Z.leb_le. split; [|apply core_ok_complete; auto].
  pose proof (zero tb R k Hk) as Hz. simpl in Hz. unfold entry_at, lap_of in Hz; simpl in Hz. fold l in Hz.
  rewrite E in Hz. rewrite Nat.div_small, Nat.mod_small in Hz by (simpl; lia). simpl in Hz. lia.
Qed.

(** ** The map *)

Let jobs_of (d : nat) := jobs w (dag_at d).

Lemma lap_is_jobs' : forall d, (d < length (w_dags w))%nat -> 0 < jobs_of d /\ jobs_of d <= H /\
  jobs_of d * d_period (dag_at d) = H.
Proof.
  intros d Hd. destruct (dags W (dag_at d) ltac:(apply nth_In; auto)) as (HT & _ & Hm & _). pose proof (a_lap W) as HH.
  unfold jobs_of, jobs. fold H. pose proof (Z.div_mod H (d_period (dag_at d)) ltac:(lia)) as E. rewrite Hm, Z.add_0_r in E.
  repeat split; nia.
Qed.

Lemma most_is_most : forall gs g, In g gs ->
  (length (d_subtasks g) <= fold_right (fun d n => Nat.max (length (d_subtasks d)) n) O gs)%nat.
Proof. induction gs as [|x gs IH]; simpl; intros g; [tauto|]. intros [->|Hin]; [lia|]. apply IH in Hin. lia. Qed.

Lemma key_injective : forall d j v d' j' v',
  (d < length (w_dags w))%nat -> (v < length (d_subtasks (dag_at d)))%nat ->
  (d' < length (w_dags w))%nat -> (v' < length (d_subtasks (dag_at d')))%nat ->
  key w d j v = key w d' j' v' -> d = d' /\ v = v' /\ j mod jobs_of d = j' mod jobs_of d.
Proof.
  intros d j v d' j' v' Hd Hv Hd' Hv' E.
  destruct (lap_is_jobs' d Hd) as (Q1 & Q2 & _). destruct (lap_is_jobs' d' Hd') as (Q1' & Q2' & _).
  pose proof (most_is_most (w_dags w) (dag_at d) ltac:(apply nth_In; auto)) as M.
  pose proof (most_is_most (w_dags w) (dag_at d') ltac:(apply nth_In; auto)) as M'.
  fold (most_subtasks w) in M, M'. unfold key in E. fold (dag_at d) (dag_at d') in E. fold (jobs_of d) (jobs_of d') H in E.
  pose proof (Z.mod_pos_bound j (jobs_of d) Q1) as B. pose proof (Z.mod_pos_bound j' (jobs_of d') Q1') as B'.
  set (a := j mod jobs_of d) in *. set (a' := j' mod jobs_of d') in *. set (m := most_subtasks w) in *.
  assert (P : 0 <= Z.of_nat m * (a + H * Z.of_nat d)) by (apply Z.mul_nonneg_nonneg; nia).
  assert (P' : 0 <= Z.of_nat m * (a' + H * Z.of_nat d')) by (apply Z.mul_nonneg_nonneg; nia).
  apply Z2Pos.inj in E; [|lia|lia].
  assert (a' + H * Z.of_nat d' = a + H * Z.of_nat d /\ Z.of_nat v' = Z.of_nat v) as [Ea Ev]
    by (apply (Z.div_mod_unique (Z.of_nat m)); lia).
  assert (Z.of_nat d' = Z.of_nat d /\ a' = a) as [Ed E'] by (apply (Z.div_mod_unique H); lia).
  assert (d' = d) by lia. subst d'. repeat split; [lia|]. unfold a, a' in E'. lia.
Qed.

Lemma index_has : forall r rs, In r rs -> exists r',
  PositiveMap.find (key w (e_dag (snd r)) (e_job (snd r)) (e_sub (snd r)))
    (fold_right (fun r m => PositiveMap.add (key w (e_dag (snd r)) (e_job (snd r)) (e_sub (snd r))) r m)
       (PositiveMap.empty row) rs) = Some r' /\ In r' rs /\
  key w (e_dag (snd r')) (e_job (snd r')) (e_sub (snd r')) = key w (e_dag (snd r)) (e_job (snd r)) (e_sub (snd r)).
Proof.
  intros r rs; induction rs as [|x rs IH]; simpl; [tauto|]. intros Hr.
  destruct (Pos.eq_dec (key w (e_dag (snd r)) (e_job (snd r)) (e_sub (snd r)))
                       (key w (e_dag (snd x)) (e_job (snd x)) (e_sub (snd x)))) as [E|E].
  - exists x. rewrite E, PositiveMap.gss. auto.
  - destruct Hr as [->|Hr]; [congruence|]. destruct (IH Hr) as (r' & H1 & H2 & H3).
    exists r'. rewrite PositiveMap.gso by auto. auto.
Qed.

(** An entry at index [i] of core [k], and its place in lap [n]. *)
Let in_lap (k i n : nat) : place := (k, (n * length (list_of w k) + i)%nat).

Lemma entry_in_lap : forall k i n, (k < length (w_lists w))%nat -> (i < length (list_of w k))%nat ->
  entry_at w (in_lap k i n) = get (list_of w k) i /\ lap_of w (in_lap k i n) = Z.of_nat n.
Proof.
  intros k i n Hk Hi. unfold in_lap, entry_at, lap_of; simpl. split.
  - rewrite Nat.add_comm, Nat.mod_add, Nat.mod_small by lia. reflexivity.
  - rewrite Nat.div_add_l, Nat.div_small by lia. f_equal. lia.
Qed.

(** Two entries of the same subtask, and of jobs that are laps apart, are one. *)
Lemma one_entry : forall k i k' i', (k < length (w_lists w))%nat -> (i < length (list_of w k))%nat ->
  (k' < length (w_lists w))%nat -> (i' < length (list_of w k'))%nat ->
  let e := get (list_of w k) i in let e' := get (list_of w k') i' in
  e_dag e = e_dag e' -> e_sub e = e_sub e' -> e_job e mod jobs_of (e_dag e) = e_job e' mod jobs_of (e_dag e) ->
  0 < jobs_of (e_dag e) -> k = k' /\ i = i'.
Proof.
  intros k i k' i' Hk Hi Hk' Hi' e e' Ed Ev Ej Hq. set (q := jobs_of (e_dag e)) in *.
  pose proof (Z.div_mod (e_job e) q ltac:(lia)) as D. pose proof (Z.div_mod (e_job e') q ltac:(lia)) as D'.
  set (x := e_job e / q) in *. set (x' := e_job e' / q) in *.
  set (n := Z.to_nat (Z.max 0 (x' - x))). set (n' := Z.to_nat (Z.max 0 (x - x'))).
  destruct (entry_in_lap k i n Hk Hi) as [E1 E2]. destruct (entry_in_lap k' i' n' Hk' Hi') as [E1' E2'].
  fold e in E1. fold e' in E1'.
  assert (P : in_lap k i n = in_lap k' i' n').
  { apply (once W); [exact Hk|exact Hk'|]. unfold instance_at, job_at. rewrite E1, E1', E2, E2', Ed, Ev. f_equal. f_equal.
    unfold dag_of. rewrite Ed. fold (dag_at (e_dag e')). rewrite <- Ed. fold (jobs_of (e_dag e)). fold q. unfold n, n'. nia. }
  unfold in_lap in P. injection P as -> P. split; auto.
  assert (M : ((n * length (list_of w k') + i) mod length (list_of w k') =
               (n' * length (list_of w k') + i') mod length (list_of w k'))%nat) by (rewrite P; auto).
  rewrite !(Nat.add_comm (_ * _)), !Nat.mod_add, !Nat.mod_small in M by lia. exact M.
Qed.

(** The map leads from each instance of the grid's residues to its entry. *)
Lemma find_complete : forall d j v, (d < length (w_dags w))%nat -> (v < length (d_subtasks (dag_at d)))%nat ->
  exists k i, (k < length (w_lists w))%nat /\ (i < length (list_of w k))%nat /\
    let e := get (list_of w k) i in
    find w (index w) d j v = Some (k, i, e) /\ e_dag e = d /\ e_sub e = v /\ e_job e mod jobs_of d = j mod jobs_of d.
Proof.
  intros d j v Hd Hv. destruct (lap_is_jobs' d Hd) as (Hq & _).
  pose proof (Z.mod_pos_bound j (jobs_of d) Hq) as B.
  destruct (everywhere W d (j mod jobs_of d) v Hd Hv ltac:(lia)) as ([k n] & Hk & Hi). simpl in Hk.
  pose proof (not_empty k Hk) as Hlen. set (i := (n mod length (list_of w k))%nat).
  assert (Hil : (i < length (list_of w k))%nat) by (apply Nat.mod_upper_bound; auto).
  unfold instance_at, job_at in Hi. injection Hi as I1 I2 I3.
  change (entry_at w (k, n)) with (get (list_of w k) i) in I1, I2, I3. set (e := get (list_of w k) i) in *.
  assert (Hjob : e_job e mod jobs_of d = j mod jobs_of d).
  { unfold dag_of in I2. rewrite I1 in I2. fold (dag_at d) in I2. fold (jobs_of d) in I2.
    rewrite <- (Z.mod_mod j (jobs_of d)) by lia. rewrite <- I2, Z.mod_add by lia. reflexivity. }
  assert (Hrow : In (k, i, e) (rows O (w_lists w))).
  { apply (rows_in w).
    exists k, i.
    split; [exact Hk|].
    split; [exact Hil|].
    reflexivity. }
  destruct (index_has _ _ Hrow) as ([[k' i'] e'] & F1 & F2 & F3). cbn [snd] in F1, F3. fold (index w) in F1.
  apply (rows_in w) in F2 as (k2 & i2 & Hk2 & Hi2 & E). injection E as -> -> ->. simpl in *.
  change (nth k2 (w_lists w) []) with (list_of w k2) in *. change (nth i2 (list_of w k2) no_entry) with (get (list_of w k2) i2) in *.
  destruct (numbers W (in_lap k2 i2 0) Hk2) as [N1 N2]. rewrite (proj1 (entry_in_lap k2 i2 0 Hk2 Hi2)) in N1, N2.
  unfold dag_of in N2. fold (dag_at (e_dag (get (list_of w k2) i2))) in N2.
  apply key_injective in F3 as (K1 & K2 & K3); auto; try (rewrite I1; auto; fail); try (rewrite I1, I3; auto; fail).
  assert (k2 = k /\ i2 = i) as [-> ->].
  { apply one_entry; auto. apply (lap_is_jobs' _ N1). }
  exists k, i. split; auto. split; auto. fold e. split; [|auto]. unfold find.
  replace (key w d j v) with (key w (e_dag e) (e_job e) (e_sub e)); [exact F1|].
  unfold key. rewrite I1, I3. fold (dag_at d). fold (jobs_of d). rewrite Hjob. reflexivity.
Qed.

Lemma wait_after_most : forall u l x, In x l -> fst x = u -> Z.max 0 (snd x) <= wait_after u l.
Proof.
  intros u l; induction l as [|[v t] l IH]; simpl; intros x Hx Hu; [tauto|].
  pose proof (wait_after_nonneg w u l). destruct Hx as [<-|Hx].
  - simpl in *. subst v. rewrite Nat.eqb_refl. lia.
  - specialize (IH x Hx Hu). destruct (Nat.eqb v u); lia.
Qed.

Lemma over_by_complete : forall k i pause job u, (k < length (w_lists w))%nat -> (i < length (list_of w k))%nat ->
  let e := get (list_of w k) i in
  (u < length (d_subtasks (dag_at (e_dag e))))%nat ->
  (forall p n, (fst p < cores tb)%nat -> instance_at w p = (e_dag e, job + Z.of_nat n * jobs_of (e_dag e), u) ->
    before tb p (in_lap k i n) /\ pause <= wait tb p (in_lap k i n)) ->
  over_by w (index w) (e_start e) pause (e_dag e) job u = true.
Proof.
  intros k i pause job u Hk Hi e Hu Hb.
  destruct (numbers W (in_lap k i 0) Hk) as [N1 _]. rewrite (proj1 (entry_in_lap k i 0 Hk Hi)) in N1. fold e in N1.
  destruct (find_complete (e_dag e) job u N1 Hu) as (k' & i' & Hk' & Hi' & F1 & F2 & F3 & F4).
  destruct (lap_is_jobs' (e_dag e) N1) as (Hq & _). set (e' := get (list_of w k') i') in *. set (q := jobs_of (e_dag e)) in *.
  unfold over_by. rewrite F1. fold (dag_at (e_dag e)) (jobs_of (e_dag e)). fold q.
  pose proof (Z.div_mod job q ltac:(lia)) as D. pose proof (Z.div_mod (e_job e') q ltac:(lia)) as D'.
  assert (S : (job - e_job e') / q = job / q - e_job e' / q).
  { replace (job - e_job e') with ((job / q - e_job e' / q) * q) by nia. apply Z.div_mul; lia. }
  rewrite S. set (x := job / q - e_job e' / q) in *.
  set (n := Z.to_nat (Z.max 0 (- x))). set (n' := Z.to_nat (Z.max 0 x)).
  destruct (entry_in_lap k i n Hk Hi) as [E1 E2]. destruct (entry_in_lap k' i' n' Hk' Hi') as [E1' E2'].
  fold e in E1. fold e' in E1'.
  destruct (Hb (in_lap k' i' n') n Hk') as [Hbef Hpause].
  { unfold instance_at, job_at. rewrite E1', E2', F2, F3. f_equal. f_equal. unfold dag_of. rewrite F2.
    fold (dag_at (e_dag e)) (jobs_of (e_dag e)). fold q. unfold n, n'. nia. }
  destruct (precedence tb R (in_lap k' i' n') (in_lap k i n) Hk Hbef) as (_ & _ & P1 & P2).
  assert (A1 : finish tb (in_lap k' i' n') = e_finish e' + Z.of_nat n' * H) by (rewrite <- E1', <- E2'; reflexivity).
  assert (A2 : start tb (in_lap k' i' n') = e_start e' + Z.of_nat n' * H) by (rewrite <- E1', <- E2'; reflexivity).
  assert (A3 : start tb (in_lap k i n) = e_start e + Z.of_nat n * H) by (rewrite <- E1, <- E2; reflexivity).
  rewrite A1, A3 in P1. rewrite A2, A3 in P2. fold H.
  assert (X : x * H = Z.of_nat n' * H - Z.of_nat n * H).
  { rewrite <- Z.mul_sub_distr_r. f_equal. unfold n, n'. lia. }
  rewrite X, andb_true_iff, Z.leb_le, Z.ltb_lt. lia.
Qed.

Lemma row_ok_complete : forall r, In r (rows O (w_lists w)) -> row_ok w (index w) r = true.
Proof.
  intros r Hr. apply (rows_in w) in Hr as (k & i & Hk & Hi & ->). simpl.
  change (nth k (w_lists w) []) with (list_of w k) in *. change (nth i (list_of w k) no_entry) with (get (list_of w k) i).
  set (e := get (list_of w k) i).
  destruct (entry_in_lap k i 0 Hk Hi) as [E1 E2]. fold e in E1.
  destruct (numbers W (in_lap k i 0) Hk) as [N1 N2]. rewrite E1 in N1, N2.
  assert (Hd : In (dag_of w e) (w_dags w)) by (apply nth_In; auto).
  destruct (lap_is_jobs' (e_dag e) N1) as (Hq & _ & HqT).
  assert (G : dag_of w e = dag_at (e_dag e)) by reflexivity.
  assert (J : forall n, job_at w (in_lap k i n) = e_job e + Z.of_nat n * jobs_of (e_dag e)).
  { intros n. destruct (entry_in_lap k i n Hk Hi) as [A1 A2]. fold e in A1. unfold job_at. rewrite A1, A2. reflexivity. }
  rewrite !andb_true_iff, !Z.leb_le, !Nat.ltb_lt, forallb_forall.
  assert (Hbound := bounds W (in_lap k i 0) Hk). assert (Hready := ready tb R (in_lap k i 0) Hk).
  simpl in Hbound, Hready. rewrite (J O), E1, E2 in Hbound, Hready. simpl in Hbound, Hready. rewrite !Z.add_0_r in *.
  split; [split; [split; [split; [split; [split; [exact N1|exact N2]|]|]|]|]|].
  - destruct (find_complete (e_dag e) (e_job e) (e_sub e) N1 N2) as (k' & i' & Hk' & Hi' & F1 & F2 & F3 & F4).
    rewrite F1. destruct (one_entry k i k' i') as [-> ->]; auto; try (fold e; congruence).
    rewrite !Nat.eqb_refl. reflexivity.
  - lia.
  - lia.
  - intros x Hx. apply over_by_complete; auto.
    { apply (edges W (dag_of w e) (subtask_of w e)); auto. apply nth_In; auto. }
    intros p n Hp Hi'. destruct (entry_in_lap k i n Hk Hi) as [A1 A2]. fold e in A1 |- *. fold e in Hi'.
    unfold instance_at in Hi'. injection Hi' as I1 I2 I3. rewrite <- (J n) in I2. split.
    + split; [exact Hp|]. rewrite A1. split; auto. left. split; auto. rewrite I3. apply in_map; auto.
    + simpl. unfold wait_of. rewrite I2, Z.eqb_refl, A1, I3. apply wait_after_most; auto.
  - apply over_by_complete; auto. intros p n Hp Hi'. destruct (entry_in_lap k i n Hk Hi) as [A1 A2]. fold e in A1 |- *.
    fold e in Hi'. unfold instance_at in Hi'. injection Hi' as I1 I2 I3. pose proof (J n) as Jn. split.
    + split; [exact Hp|]. rewrite A1. split; auto. right. split; auto. lia.
    + simpl. unfold wait_of. destruct (Z.eqb_spec (job_at w p) (job_at w (in_lap k i n))); [lia|lia].
Qed.

Lemma complete_complete : forall d, (d < length (w_dags w))%nat -> complete w (index w) d = true.
Proof.
  intros d Hd. unfold complete. fold (dag_at d) (jobs_of d). rewrite forallb_forall. intros j Hj. apply in_seq in Hj.
  rewrite forallb_forall. intros v Hv. apply in_seq in Hv. destruct (lap_is_jobs' d Hd) as (Hq & _).
  destruct (find_complete d (Z.of_nat j) v Hd ltac:(lia)) as (k & i & Hk & Hi & F1 & F2 & F3 & F4). rewrite F1.
  set (e := get (list_of w k) i) in *. rewrite F2, F3, !Nat.eqb_refl. rewrite !andb_true_iff, Z.leb_le, Z.eqb_eq.
  split; [split; [auto|]|].
  - destruct (everywhere W d (Z.of_nat j) v Hd ltac:(lia) ltac:(lia)) as ([k' n] & Hk' & E). simpl in Hk'.
    pose proof (not_empty k' Hk') as Hlen. unfold instance_at, job_at in E. injection E as E1 E2 E3.
    set (i' := (n mod length (list_of w k'))%nat). change (entry_at w (k', n)) with (get (list_of w k') i') in *.
    assert (Hi' : (i' < length (list_of w k'))%nat) by (apply Nat.mod_upper_bound; auto).
    unfold dag_of in E2. rewrite E1 in E2. fold (dag_at d) in E2. fold (jobs_of d) in E2.
    destruct (one_entry k i k' i') as [-> ->]; auto; fold e; try congruence.
    + rewrite F2, F4, <- E2, Z.mod_add by lia. reflexivity.
    + fold e in E2. unfold lap_of in E2. nia.
  - rewrite Zminus_mod, F4, Z.sub_diag, Zmod_0_l. reflexivity.
Qed.

(** **The checker accepts every well-formed witness whose table is right.** *)
Theorem right_is_accepted : check w = true.
Proof.
  unfold check. fold H. rewrite !andb_true_iff, Z.ltb_lt, !forallb_forall. split; [split; [split|]|split].
  - exact (a_lap W).
  - intros d Hd. destruct (dags W d Hd) as (H1 & H2 & H3 & H4). unfold dag_ok. fold H.
    rewrite !andb_true_iff, Z.ltb_lt, Z.leb_le, Z.eqb_eq, forallb_forall. repeat split; auto.
    intros v Hv. apply andb_true_intro. split; [apply Z.leb_le; auto|].
    rewrite forallb_forall. intros x Hx. apply Nat.ltb_lt. apply (edges W d v x); auto.
  - intros l Hl. apply In_nth with (d := []) in Hl as (k & Hk & <-). apply (list_ok_complete k Hk).
  - intros r Hr. apply row_ok_complete; auto.
  - intros d Hd. apply in_seq in Hd. apply complete_complete. lia.
Qed.

End Complete.

Lemma accepted_is_well_formed : forall w, check w = true -> well_formed w.
Proof.
  intros w A. destruct (parts w A) as (HH & Hg & Hl & _). rewrite forallb_forall in Hg, Hl.
  assert (G : forall d, In d (w_dags w) -> 0 < d_period d /\ 0 <= d_offset d /\ w_lap w mod d_period d = 0 /\
    forall v, In v (d_subtasks d) -> 0 <= s_wcet v /\ forall x, In x (s_preds v) -> (fst x < length (d_subtasks d))%nat).
  { intros d Hd. specialize (Hg d Hd). unfold dag_ok in Hg.
    rewrite !andb_true_iff, Z.ltb_lt, Z.leb_le, Z.eqb_eq, forallb_forall in Hg. destruct Hg as [[[H1 H2] H3] H4].
    repeat split; auto; specialize (H4 v H); rewrite andb_true_iff, Z.leb_le, forallb_forall in H4; destruct H4 as [H4 H5]; auto.
    intros x Hx. apply Nat.ltb_lt. auto. }
  constructor.
  - exact HH.
  - intros d Hd. destruct (G d Hd) as (H1 & H2 & H3 & H4). repeat split; auto. intros v Hv. apply (H4 v Hv).
  - intros l Hin ->. specialize (Hl [] Hin). discriminate.
  - intros p Hp. destruct (row_at w A p Hp) as (_ & H1 & H2 & _). auto.
  - intros d v x Hd Hv Hx. destruct (G d Hd) as (_ & _ & _ & H4). apply (H4 v Hv); auto.
  - intros p Hp. destruct (row_at w A p Hp) as (Hin & _ & _ & _ & _ & Hb & _).
    destruct (lap_is_jobs w A _ Hin) as (_ & _ & _ & Hq). simpl. unfold job_at, nominal in *. nia.
  - intros k n Hk Ha. destruct (list_ok_sound w _ (Hl (list_of w k) ltac:(apply nth_In; auto))) as (_ & _ & Hs).
    destruct (Hs n) as (_ & _ & Hnp). apply Hnp. exact Ha.
  - apply instance_has_place; auto.
  - apply instance_has_one_place; auto.
Qed.

(** **The checker decides**: it accepts a witness if and only if the witness is well formed and its endless table is right. *)
Theorem check_decides : forall w, check w = true <-> well_formed w /\ right (table_of w).
Proof.
  intros w. split.
  - intros A. split; [apply accepted_is_well_formed|apply accepted_is_right]; auto.
  - intros [W R]. apply right_is_accepted; auto.
Qed.



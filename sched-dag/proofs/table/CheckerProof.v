(** * An accepted table is right, and its bounds hold in every run *)

From Coq Require Import ZArith List Bool Lia FMapPositive.
From Table Require Import Model Sustainable Checker.
Import ListNotations.
Open Scope Z_scope.

(** ** Sums over an endless list *)

Fixpoint sum (f : nat -> Z) (i n : nat) : Z :=
  match n with O => 0 | S n => f i + sum f (S i) n end.

Lemma sum_ext : forall f g n i j, (forall a, (a < n)%nat -> f (i + a)%nat = g (j + a)%nat) -> sum f i n = sum g j n.
Proof.
  intros f g n; induction n; simpl; intros i j H; auto.
  pose proof (H O ltac:(lia)) as H0. rewrite !Nat.add_0_r in H0. rewrite H0. f_equal.
  apply IHn. intros a Ha. specialize (H (S a) ltac:(lia)). rewrite !Nat.add_succ_r in H. auto.
Qed.

Lemma work_is_sum : forall tb k n i, work tb k i n = sum (fun j => wcet tb (k, j)) i n.
Proof. intros tb k n; induction n; simpl; intros; auto. rewrite IHn; auto. Qed.

Section Accepted.
Variable w : witness.
Let H := w_lap w.
Let tb := table_of w.
Let get (l : list entry) (i : nat) := nth i l no_entry.

(** ** One core *)

Lemma nested_sound : forall d rest acc s z, nested w d acc rest = Some (s, z) ->
  exists n, (n < length rest)%nat /\ get rest n = z /\
    (forall j, (j < n)%nat -> d < e_depth (get rest j)) /\ e_depth z <= d /\
    s = acc + sum (fun j => cost w (get rest j)) 0 n.
Proof.
  intros d rest; induction rest as [|x rest IH]; simpl; intros acc s z E; [discriminate|].
  destruct (e_depth x <=? d) eqn:D.
  - injection E as <- <-. apply Z.leb_le in D. exists O; simpl. repeat split; auto; try lia.
  - apply Z.leb_gt in D. destruct (IH _ _ _ E) as (n & Hn & Hz & Hj & Hd & Hs).
    exists (S n). repeat split; auto; try lia.
    + intros [|j] Hlt; simpl; auto. apply Hj; lia.
    + rewrite Hs; simpl. rewrite <- Z.add_assoc. do 2 f_equal. apply sum_ext; intros; auto.
Qed.

Definition family_in (l : list entry) (i : nat) : Prop :=
  (S i < length l)%nat /\ e_start (get l i) <= e_start (get l (S i)) /\
  (exists n, (S i + n < length l)%nat /\
    (forall j, (i < j < S i + n)%nat -> e_depth (get l i) < e_depth (get l j)) /\
    e_depth (get l (S i + n)) <= e_depth (get l i) /\
    e_finish (get l i) <= e_start (get l (S i + n)) /\
    e_start (get l i) + cost w (get l i) + sum (fun j => cost w (get l j)) (S i) n <= e_finish (get l i)) /\
  (s_alone (subtask_of w (get l i)) = true -> e_depth (get l (S i)) <= e_depth (get l i)).

Lemma core_ok_sound : forall n l, core_ok w n l = true -> forall i, (i < n)%nat -> family_in l i.
Proof.
  induction n; intros l E i Hi; [lia|].
  destruct l as [|x [|y rest]]; [discriminate|discriminate|].
  cbn [core_ok] in E. apply andb_prop in E as [E1 E2].
  destruct i as [|i].
  - destruct (nested w (e_depth x) (cost w x) (y :: rest)) as [[s z]|] eqn:N; [|discriminate].
    destruct (nested_sound _ _ _ _ _ N) as (m & Hm & Hz & Hj & Hd & Hs).
    rewrite !andb_true_iff, !Z.leb_le, orb_true_iff, negb_true_iff, Z.leb_le in E1.
    destruct E1 as [[[E1 E3] E4] E5].
    split; [simpl; lia|]. split; [exact E1|]. split.
    + exists m. split; [simpl in *; lia|]. change (get (x :: y :: rest) 0) with x.
      change (get (x :: y :: rest) (1 + m)) with (get (y :: rest) m). rewrite Hz. repeat split; auto.
      * intros [|j] Hlt; [lia|]. apply (Hj j); lia.
      * replace (sum (fun j => cost w (get (x :: y :: rest) j)) 1 m)
          with (sum (fun j => cost w (get (y :: rest) j)) 0 m) by (apply sum_ext; intros; auto). lia.
    + intros Ha. change (get (x :: y :: rest) 0) with x in *. destruct E5 as [E5|E5]; [congruence|exact E5].
  - destruct (IHn _ E2 i ltac:(lia)) as (F1 & F2 & (m & F3 & F4 & F5 & F6 & F7) & F8).
    split; [simpl in *; lia|]. split; [exact F2|]. split; [|exact F8].
    exists m. split; [simpl in *; lia|]. split; [|split; [exact F5|split; [exact F6|]]].
    + intros [|j] Hlt; [lia|]. apply (F4 j); lia.
    + replace (sum (fun j => cost w (get (x :: y :: rest) j)) (S (S i)) m)
        with (sum (fun j => cost w (get (y :: rest) j)) (S i) m) by (apply sum_ext; intros; auto). exact F7.
Qed.

(** The endless list of [l]. *)
Let line (l : list entry) (n : nat) : entry :=
  later (Z.of_nat (n / length l) * H) (get l (n mod length l)).

Lemma later_later : forall a b e, later a (later b e) = later (a + b) e.
Proof. intros a b [? ? ? ? ? ?]; unfold later; simpl; f_equal; lia. Qed.

Lemma later_0 : forall e, later 0 e = e.
Proof. intros [? ? ? ? ? ?]; unfold later; simpl; f_equal; lia. Qed.

Lemma later_start : forall t e, e_start (later t e) = e_start e + t. Proof. reflexivity. Qed.
Lemma later_finish : forall t e, e_finish (later t e) = e_finish e + t. Proof. reflexivity. Qed.
Lemma later_depth : forall t e, e_depth (later t e) = e_depth e. Proof. reflexivity. Qed.
Lemma later_cost : forall t e, cost w (later t e) = cost w e. Proof. reflexivity. Qed.

Lemma line_shift : forall l a j, l <> [] -> line l (a * length l + j) = later (Z.of_nat a * H) (line l j).
Proof.
  intros l a j Hl. assert (Hn : length l <> O) by (destruct l; simpl; congruence).
  unfold line. rewrite later_later, Nat.div_add_l by auto.
  rewrite (Nat.add_comm (a * length l)), Nat.mod_add by auto. f_equal. lia.
Qed.

Lemma two_laps : forall l n, (n < length l + length l)%nat -> get (l ++ map (later H) l) n = line l n.
Proof.
  intros l n Hn. unfold get, line.
  destruct (Nat.lt_ge_cases n (length l)) as [Hlt|Hge].
  - rewrite app_nth1, Nat.div_small, Nat.mod_small by auto. simpl. rewrite later_0. reflexivity.
  - rewrite app_nth2 by lia.
    rewrite nth_indep with (d' := later H no_entry) by (rewrite map_length; lia).
    rewrite map_nth.
    replace n with (1 * length l + (n - length l))%nat at 2 3 by lia.
    rewrite Nat.div_add_l by lia. rewrite (Nat.add_comm (1 * length l)), Nat.mod_add by lia.
    rewrite Nat.div_small, Nat.mod_small by lia. f_equal. simpl. destruct H; auto.
Qed.

Lemma list_ok_sound : forall l, list_ok w l = true ->
  l <> [] /\ 0 <= e_start (line l 0) /\ forall n,
  e_start (line l n) <= e_start (line l (S n)) /\
  (exists m,
    (forall j, (n < j < S n + m)%nat -> e_depth (line l n) < e_depth (line l j)) /\
    e_depth (line l (S n + m)) <= e_depth (line l n) /\
    e_finish (line l n) <= e_start (line l (S n + m)) /\
    e_start (line l n) + cost w (line l n) + sum (fun j => cost w (line l j)) (S n) m <= e_finish (line l n)) /\
  (s_alone (subtask_of w (line l n)) = true -> e_depth (line l (S n)) <= e_depth (line l n)).
Proof.
  intros l E. destruct l as [|x0 l0]; [discriminate|]. unfold list_ok in E.
  set (l := x0 :: l0) in *.
  apply andb_prop in E as [E0 E]. assert (Hl : l <> []) by (unfold l; congruence).
  assert (Hlen : length l <> O) by (unfold l; simpl; lia).
  split; [auto|]. split.
  { unfold line. rewrite Nat.div_small, Nat.mod_small by lia. apply Z.leb_le in E0.
    change (0 <= e_start x0 + 0). lia. }
  clearbody l. intros n.
  set (i := (n mod length l)%nat). set (a := (n / length l)%nat).
  assert (Hi : (i < length l)%nat) by (apply Nat.mod_upper_bound; auto).
  assert (Hn : n = (a * length l + i)%nat) by (rewrite Nat.mul_comm; apply Nat.div_mod; auto).
  fold H in E. destruct (core_ok_sound _ _ E i Hi) as (F1 & F2 & (m & F3 & F4 & F5 & F6 & F7) & F8).
  rewrite app_length, map_length in F1, F3.
  assert (L : forall j, (j < length l + length l)%nat ->
    line l (a * length l + j) = later (Z.of_nat a * H) (get (l ++ map (later H) l) j)).
  { intros j Hj. rewrite line_shift, two_laps by auto. reflexivity. }
  rewrite Hn. rewrite (L i) by lia.
  replace (S (a * length l + i)) with (a * length l + S i)%nat by lia.
  rewrite (L (S i)) by lia. change (dag_of w (later (Z.of_nat a * H) (get (l ++ map (later H) l) i)))
    with (dag_of w (get (l ++ map (later H) l) i)).
  rewrite !later_start, !later_finish, !later_depth, later_cost. split; [lia|]. split; [|exact F8].
  exists m. replace (a * length l + S i + m)%nat with (a * length l + (S i + m))%nat by lia.
  rewrite (L (S i + m)%nat), later_start, later_depth by lia. split; [|split; [|split]]; auto; try lia.
  - intros j Hj. replace j with (a * length l + (j - a * length l))%nat by lia.
    rewrite L, later_depth by lia. apply F4. lia.
  - replace (sum (fun j => cost w (line l j)) (a * length l + S i) m)
      with (sum (fun j => cost w (get (l ++ map (later H) l) j)) (S i) m); [lia|].
    apply sum_ext. intros b Hb. replace (a * length l + S i + b)%nat with (a * length l + (S i + b))%nat by lia.
    rewrite L by lia. reflexivity.
Qed.

(** ** The map *)

Lemma rows_of_in : forall k l i0 r, In r (rows_of k i0 l) <->
  exists i, (i < length l)%nat /\ r = (k, (i0 + i)%nat, get l i).
Proof.
  intros k l; induction l as [|e l IH]; simpl; intros i0 r; split; try tauto.
  - intros (i & Hi & _); lia.
  - intros [<-|Hr].
    + exists O. split; [lia|]. rewrite Nat.add_0_r. reflexivity.
    + apply IH in Hr as (i & Hi & ->). exists (S i). split; [lia|]. rewrite Nat.add_succ_r. reflexivity.
  - intros ([|i] & Hi & ->).
    + left. rewrite Nat.add_0_r. reflexivity.
    + right. apply IH. exists i. split; [lia|]. rewrite Nat.add_succ_r. reflexivity.
Qed.

Lemma rows_in : forall ls k0 r, In r (rows k0 ls) <->
  exists k i, (k < length ls)%nat /\ (i < length (nth k ls []))%nat /\ r = ((k0 + k)%nat, i, get (nth k ls []) i).
Proof.
  induction ls as [|l ls IH]; simpl; intros k0 r; split; try tauto.
  - intros (k & i & Hk & _); lia.
  - intros Hr. apply in_app_or in Hr as [Hr|Hr].
    + apply rows_of_in in Hr as (i & Hi & ->). exists O, i. rewrite Nat.add_0_r. repeat split; auto; lia.
    + apply IH in Hr as (k & i & Hk & Hi & ->). exists (S k), i. rewrite Nat.add_succ_r. repeat split; auto; lia.
  - intros ([|k] & i & Hk & Hi & ->); apply in_or_app.
    + left. apply rows_of_in. exists i. rewrite Nat.add_0_r. auto.
    + right. apply IH. exists k, i. rewrite Nat.add_succ_r. repeat split; auto; lia.
Qed.

Lemma find_in : forall d j v r, find w (index w) d j v = Some r -> In r (rows O (w_lists w)).
Proof.
  intros d j v r. unfold find, index. induction (rows O (w_lists w)) as [|x l IH]; simpl.
  - rewrite PositiveMap.gempty. discriminate.
  - destruct (Pos.eq_dec (key w d j v) (key w (e_dag (snd x)) (e_job (snd x)) (e_sub (snd x)))) as [E|E].
    + rewrite E, PositiveMap.gss. intros [= ->]. auto.
    + rewrite PositiveMap.gso by auto. auto.
Qed.

Lemma find_row : forall d j v k i e, find w (index w) d j v = Some (k, i, e) ->
  (k < length (w_lists w))%nat /\ (i < length (list_of w k))%nat /\ e = get (list_of w k) i.
Proof.
  intros d j v k i e E. apply find_in, rows_in in E as (k' & i' & Hk & Hi & E). simpl in E.
  injection E as -> -> ->. auto.
Qed.

Lemma find_same_lap : forall m d j j' v,
  j mod jobs w (nth d (w_dags w) no_dag) = j' mod jobs w (nth d (w_dags w) no_dag) -> find w m d j v = find w m d j' v.
Proof. intros m d j j' v E. unfold find, key. rewrite E. reflexivity. Qed.

(** ** The whole table *)

Hypothesis accepted : check w = true.

Lemma parts : 0 < H /\ forallb (dag_ok w) (w_dags w) = true /\ forallb (list_ok w) (w_lists w) = true /\
  forallb (row_ok w (index w)) (rows O (w_lists w)) = true /\
  forallb (complete w (index w)) (seq 0 (length (w_dags w))) = true.
Proof.
  pose proof accepted as A. unfold check in A. rewrite !andb_true_iff, Z.ltb_lt in A. fold H in A. tauto.
Qed.

Lemma lap_is_jobs : forall d, In d (w_dags w) ->
  0 < d_period d /\ 0 <= d_offset d /\ 0 < jobs w d /\ jobs w d * d_period d = H.
Proof.
  intros d Hd. destruct parts as (HH & Hg & _). rewrite forallb_forall in Hg. specialize (Hg d Hd).
  unfold dag_ok in Hg. rewrite !andb_true_iff, Z.ltb_lt, Z.leb_le, Z.eqb_eq in Hg.
  destruct Hg as [[[HT HO] Hm] _]. fold H in Hm. unfold jobs. fold H.
  pose proof (Z.div_mod H (d_period d) ltac:(lia)) as E. rewrite Hm, Z.add_0_r in E.
  repeat split; auto; nia.
Qed.

Lemma cost_nonneg : forall e, 0 <= cost w e.
Proof.
  intros e. unfold cost, subtask_of.
  destruct (nth_in_or_default (e_sub e) (d_subtasks (dag_of w e)) no_subtask) as [Hs| ->]; [|simpl; lia].
  unfold dag_of in *. destruct (nth_in_or_default (e_dag e) (w_dags w) no_dag) as [Hd|Hd].
  - destruct parts as (_ & Hg & _). rewrite forallb_forall in Hg. specialize (Hg _ Hd).
    unfold dag_ok in Hg. apply andb_prop in Hg as [_ Hv]. rewrite forallb_forall in Hv.
    specialize (Hv _ Hs). apply andb_prop in Hv as [Hv _]. apply Z.leb_le in Hv. auto.
  - rewrite Hd in Hs at 2. contradiction.
Qed.

(** What the checker established of the entry at a place. *)
Lemma row_at : forall p, (fst p < length (w_lists w))%nat -> let e := entry_at w p in
  In (dag_of w e) (w_dags w) /\ (e_dag e < length (w_dags w))%nat /\ (e_sub e < length (d_subtasks (dag_of w e)))%nat /\
  find w (index w) (e_dag e) (e_job e) (e_sub e) = Some (fst p, (snd p mod length (list_of w (fst p)))%nat, e) /\
  nominal (dag_of w e) (e_job e) <= e_start e /\
  e_finish e <= nominal (dag_of w e) (e_job e) + s_bound (subtask_of w e) /\
  (forall x, In x (s_preds (subtask_of w e)) ->
    over_by w (index w) (e_start e) (Z.max 0 (snd x)) (e_dag e) (e_job e) (fst x) = true) /\
  over_by w (index w) (e_start e) 0 (e_dag e) (e_job e - 1) (e_sub e) = true.
Proof.
  intros [k n] Hk e. simpl in Hk.
  destruct parts as (_ & _ & Hl & Hr & _). rewrite forallb_forall in Hl, Hr.
  assert (Hin : In (list_of w k) (w_lists w)) by (apply nth_In; auto).
  assert (Hlen : length (list_of w k) <> O).
  { specialize (Hl _ Hin). destruct (list_of w k); simpl; [discriminate|lia]. }
  set (i := (n mod length (list_of w k))%nat).
  assert (Hi : (i < length (list_of w k))%nat) by (apply Nat.mod_upper_bound; auto).
  assert (Hrow : In (k, i, e) (rows O (w_lists w))) by (apply rows_in; exists k, i; auto).
  specialize (Hr _ Hrow). unfold row_ok in Hr.
  rewrite !andb_true_iff, !Z.leb_le, !Nat.ltb_lt, forallb_forall in Hr.
  destruct Hr as [[[[[[Hd Hv] Hf] H1] H2] H3] H4].
  split; [unfold dag_of; apply nth_In; auto|]. repeat split; auto.
  destruct (find w (index w) (e_dag e) (e_job e) (e_sub e)) as [[[k' i'] e']|] eqn:E; [|discriminate].
  apply andb_prop in Hf as [Hk' Hi']. apply Nat.eqb_eq in Hk', Hi'. subst k' i'.
  destruct (find_row _ _ _ _ _ _ E) as (_ & _ & ->). reflexivity.
Qed.

Lemma over_by_sound : forall p y u job t, (fst p < length (w_lists w))%nat -> (fst y < length (w_lists w))%nat ->
  e_dag (entry_at w p) = e_dag (entry_at w y) -> e_sub (entry_at w p) = u ->
  job_at w p = job + lap_of w y * jobs w (dag_of w (entry_at w y)) ->
  over_by w (index w) (e_start (entry_at w y)) t (e_dag (entry_at w y)) job u = true ->
  finish tb p + t <= start tb y /\ start tb p < start tb y.
Proof.
  intros p y u job t Hp Hy Hd Hu Hj Ho.
  destruct (row_at p Hp) as (_ & _ & _ & Hf & _). destruct (row_at y Hy) as (Hin & _).
  destruct (lap_is_jobs _ Hin) as (_ & _ & Hq & _).
  unfold job_at in Hj. assert (Hg : dag_of w (entry_at w p) = dag_of w (entry_at w y)) by (unfold dag_of; congruence).
  rewrite Hg in Hj. unfold over_by in Ho.
  assert (E : find w (index w) (e_dag (entry_at w y)) job u =
              find w (index w) (e_dag (entry_at w p)) (e_job (entry_at w p)) (e_sub (entry_at w p))).
  { rewrite Hu, <- Hd. apply find_same_lap. change (nth (e_dag (entry_at w p)) (w_dags w) no_dag) with (dag_of w (entry_at w p)).
    rewrite Hg. set (q := jobs w (dag_of w (entry_at w y))) in *.
    replace job with (e_job (entry_at w p) + (lap_of w p - lap_of w y) * q) by lia.
    rewrite Z.mod_add by lia. reflexivity. }
  rewrite E, Hf in Ho. change (nth (e_dag (entry_at w y)) (w_dags w) no_dag) with (dag_of w (entry_at w y)) in Ho.
  set (q := jobs w (dag_of w (entry_at w y))) in *.
  replace (job - e_job (entry_at w p)) with ((lap_of w p - lap_of w y) * q) in Ho by lia.
  rewrite Z.div_mul in Ho by lia. rewrite andb_true_iff, Z.leb_le, Z.ltb_lt in Ho.
  unfold tb, table_of; simpl. fold H in Ho |- *. lia.
Qed.

Lemma wait_after_nonneg : forall u l, 0 <= wait_after u l.
Proof. intros u l; induction l as [|[v t] l IH]; simpl; [lia|]. destruct (Nat.eqb v u); lia. Qed.

Lemma wait_after_sound : forall u l a b, a <= b ->
  (forall x, In x l -> fst x = u -> a + Z.max 0 (snd x) <= b) -> a + wait_after u l <= b.
Proof.
  intros u l a b Hab; induction l as [|[v t] l IH]; simpl; intros Hl; [lia|].
  assert (a + wait_after u l <= b) by (apply IH; intros; apply Hl; auto).
  destruct (Nat.eqb_spec v u) as [->|]; auto. specialize (Hl (u, t) (or_introl eq_refl) eq_refl). simpl in Hl.
  pose proof (wait_after_nonneg u l). lia.
Qed.

(** **An accepted table is right.** *)
Theorem accepted_is_right : right tb.
Proof.
  destruct parts as (_ & _ & Hl & _). rewrite forallb_forall in Hl.
  assert (Hline : forall k, (k < length (w_lists w))%nat -> list_ok w (list_of w k) = true)
    by (intros; apply Hl, nth_In; auto).
  assert (Hstart : forall k n, start tb (k, n) = e_start (line (list_of w k) n)) by reflexivity.
  assert (Hfinish : forall k n, finish tb (k, n) = e_finish (line (list_of w k) n)) by reflexivity.
  assert (Hdepth : forall k n, depth tb (k, n) = e_depth (line (list_of w k) n)) by reflexivity.
  assert (Hcost : forall k n, wcet tb (k, n) = cost w (line (list_of w k) n)) by reflexivity.
  constructor; [constructor| |].
  - intros p _. apply cost_nonneg.
  - intros k i Hk. destruct (list_ok_sound _ (Hline k Hk)) as (_ & _ & Hs). apply (Hs i).
  - intros k x Hk. destruct (list_ok_sound _ (Hline k Hk)) as (_ & _ & Hs).
    destruct (Hs x) as (_ & (m & F1 & F2 & F3 & F4) & _).
    exists m. rewrite work_is_sum. unfold encloses. split; [split; [left; split|]|]; auto.
  - intros p y Hy (Hp & Hd & Hj). split; auto.
    destruct (row_at y Hy) as (_ & _ & _ & _ & _ & _ & Hpred & Hbefore).
    change (wait tb p y) with (wait_of w p y). unfold wait_of.
    destruct Hj as [[Hj Hv]|[Hj Hv]].
    + assert (E : forall x, In x (s_preds (subtask_of w (entry_at w y))) -> fst x = e_sub (entry_at w p) ->
        finish tb p + Z.max 0 (snd x) <= start tb y /\ start tb p < start tb y).
      { intros x Hx Hu. apply (over_by_sound p y (e_sub (entry_at w p)) (e_job (entry_at w y))); auto.
        rewrite <- Hu. apply Hpred; auto. }
      apply in_map_iff in Hv as (x & Hu & Hx). pose proof (E x Hx Hu) as [E1 E2].
      rewrite Hj, Z.eqb_refl. pose proof (wait_after_nonneg (e_sub (entry_at w p)) (s_preds (subtask_of w (entry_at w y)))).
      split; auto. split; [|lia]. apply wait_after_sound; [lia|]. intros; apply E; auto.
    + destruct (Z.eqb_spec (job_at w p) (job_at w y)) as [|_]; [lia|]. split; [lia|].
      apply (over_by_sound p y (e_sub (entry_at w y)) (e_job (entry_at w y) - 1)); auto.
      rewrite Hj. unfold job_at. lia.
  - intros k Hk. destruct (list_ok_sound _ (Hline k Hk)) as (_ & Hz & _). exact Hz.
  - intros p Hp. destruct (row_at p Hp) as (Hin & _ & _ & _ & H1 & _).
    destruct (lap_is_jobs _ Hin) as (_ & _ & _ & Hq). simpl. unfold job_at, nominal in *. fold H.
    rewrite Z.mul_add_distr_r, <- Z.mul_assoc, Hq. lia.
Qed.

(** **Each instance is at exactly one place**: subtask [v] of job [job] of DAG [d], from the grid's job 0 on. *)
Theorem instance_has_place : forall d job v, (d < length (w_dags w))%nat ->
  (v < length (d_subtasks (nth d (w_dags w) no_dag)))%nat -> 0 <= job ->
  exists p, (fst p < cores tb)%nat /\ instance_at w p = (d, job, v).
Proof.
  intros d job v Hd Hv Hj. destruct parts as (_ & _ & Hl & _ & Hc). rewrite forallb_forall in Hc, Hl.
  specialize (Hc d ltac:(apply in_seq; lia)). unfold complete in Hc.
  set (g := nth d (w_dags w) no_dag) in *.
  destruct (lap_is_jobs g ltac:(apply nth_In; auto)) as (_ & _ & Hq & _). set (q := jobs w g) in *.
  pose proof (Z.mod_pos_bound job q Hq) as Hm.
  rewrite forallb_forall in Hc. specialize (Hc (Z.to_nat (job mod q)) ltac:(apply in_seq; lia)).
  rewrite forallb_forall in Hc. specialize (Hc v ltac:(apply in_seq; lia)). rewrite Z2Nat.id in Hc by lia.
  destruct (find w (index w) d (job mod q) v) as [[[k i] e]|] eqn:E; [|discriminate].
  rewrite !andb_true_iff, Z.leb_le, Z.eqb_eq, !Nat.eqb_eq in Hc. destruct Hc as [[[H1 H2] H3] H4].
  destruct (find_row _ _ _ _ _ _ E) as (Hk & Hi & He).
  pose proof (Z.div_mod job q ltac:(lia)) as Ej. pose proof (Z.div_pos job q ltac:(lia) ltac:(lia)) as Hjq.
  pose proof (Z.div_mod (job mod q - e_job e) q ltac:(lia)) as Em. rewrite H4, Z.add_0_r in Em.
  pose proof (Z.div_pos (job mod q - e_job e) q ltac:(lia) ltac:(lia)) as Hl'.
  set (n := job / q + (job mod q - e_job e) / q) in *.
  exists (k, (Z.to_nat n * length (list_of w k) + i)%nat). split; [exact Hk|].
  assert (Hlen : length (list_of w k) <> O) by lia.
  assert (Hat : entry_at w (k, (Z.to_nat n * length (list_of w k) + i)%nat) = e).
  { unfold entry_at; simpl. rewrite (Nat.add_comm (_ * _)), Nat.mod_add, Nat.mod_small by lia. auto. }
  unfold instance_at, job_at. rewrite Hat, H1, H2. do 2 f_equal.
  unfold lap_of; simpl. rewrite Nat.div_add_l, Nat.div_small by lia. rewrite Nat.add_0_r, Z2Nat.id by lia.
  unfold dag_of. rewrite H1. fold g. fold q. unfold n. lia.
Qed.

Theorem instance_has_one_place : forall p p', (fst p < cores tb)%nat -> (fst p' < cores tb)%nat ->
  instance_at w p = instance_at w p' -> p = p'.
Proof.
  intros p p' Hp Hp' E. unfold instance_at in E. injection E as Ed Ej Ev.
  destruct (row_at p Hp) as (Hin & _ & _ & Hf & _). destruct (row_at p' Hp') as (_ & _ & _ & Hf' & _).
  destruct (lap_is_jobs _ Hin) as (_ & _ & Hq & _).
  unfold job_at in Ej. assert (Hg : dag_of w (entry_at w p') = dag_of w (entry_at w p)) by (unfold dag_of; congruence).
  rewrite Hg in Ej. set (q := jobs w (dag_of w (entry_at w p))) in *.
  rewrite <- Ed, <- Ev in Hf'. rewrite find_same_lap with (j' := e_job (entry_at w p)) in Hf'.
  - rewrite Hf in Hf'. destruct p as [k n], p' as [k' n']; simpl in *. injection Hf' as -> Hmod He.
    rewrite He in Ej. f_equal. assert (Hlap : lap_of w (k', n) = lap_of w (k', n')) by nia.
    unfold lap_of in Hlap; simpl in Hlap.
    destruct parts as (_ & _ & Hl & _). rewrite forallb_forall in Hl.
    assert (Hlen : length (list_of w k') <> O).
    { specialize (Hl (list_of w k') ltac:(apply nth_In; auto)). destruct (list_of w k'); simpl; [discriminate|lia]. }
    rewrite (Nat.div_mod n (length (list_of w k'))), (Nat.div_mod n' (length (list_of w k'))) by auto.
    rewrite Hmod. f_equal. f_equal. lia.
  - change (nth (e_dag (entry_at w p)) (w_dags w) no_dag) with (dag_of w (entry_at w p)). fold q.
    replace (e_job (entry_at w p')) with (e_job (entry_at w p) + (lap_of w p - lap_of w p') * q) by lia.
    rewrite Z.mod_add by lia. reflexivity.
Qed.

(** ** Bounds *)

(** Each instance has a place, and is finished in the table within its stated bound. *)
Lemma finish_of_instance : forall d n v, (d < length (w_dags w))%nat -> let g := nth d (w_dags w) no_dag in
  (v < length (d_subtasks g))%nat -> 0 <= n ->
  exists p, (fst p < cores tb)%nat /\ instance_at w p = (d, n + d_offset g / d_period g, v) /\
    finish tb p <= d_offset g + n * d_period g + s_bound (nth v (d_subtasks g) no_subtask).
Proof.
  intros d n v Hd g Hv Hn.
  destruct (lap_is_jobs g ltac:(apply nth_In; auto)) as (HT & HO & Hq & HqT).
  destruct (instance_has_place d (n + d_offset g / d_period g) v Hd Hv) as (p & Hp & Hi).
  { pose proof (Z.div_pos (d_offset g) (d_period g)). lia. }
  exists p. split; auto. split; auto.
  destruct (row_at p Hp) as (_ & _ & _ & _ & _ & Hb & _).
  unfold instance_at, job_at in Hi. injection Hi as Hi1 Hi2 Hi3.
  assert (Hg : dag_of w (entry_at w p) = g) by (unfold dag_of; rewrite Hi1; reflexivity).
  unfold subtask_of in Hb. rewrite Hg in Hi2, Hb. rewrite Hi3 in Hb.
  unfold tb, table_of; simpl. fold H. unfold nominal, origin in Hb.
  pose proof (Z.div_mod (d_offset g) (d_period g) ltac:(lia)) as EO. nia.
Qed.

(** **The checker's theorem.** If the checker accepts a table, then in every run that obeys the rules, with releases at most
    [late] late: each subtask [v] of each job [n] of each DAG [d] has its one place in the lists, and while it is not
    finished (or passed, as void) there, no more time has gone by since the nominal release of its job than the
    stated bound, [late], and what was lost (overruns, stalls).
    Left out: DAGs that are not in the table (members); that the table meets its DAGs' deadlines (compare the stated bounds
    with them). *)
Theorem accepted_bounds_hold : forall env late s,
  0 <= late -> punctual tb env late -> run tb env initial s ->
  forall d n v, (d < length (w_dags w))%nat -> let g := nth d (w_dags w) no_dag in
  (v < length (d_subtasks g))%nat -> 0 <= n ->
  exists p, (fst p < cores tb)%nat /\ instance_at w p = (d, n + d_offset g / d_period g, v) /\
    (~ finished s p ->
     now s <= d_offset g + n * d_period g + s_bound (nth v (d_subtasks g) no_subtask) + late + lost s).
Proof.
  intros env late s Hl Hpun Hrun d n v Hd g Hv Hn.
  destruct (finish_of_instance d n v Hd Hv Hn) as (p & Hp & Hi & Hf). fold g in Hi, Hf.
  exists p. split; auto. split; auto. intros Hnf.
  destruct (sustainable tb accepted_is_right env late Hpun Hl s Hrun p Hp) as [_ Hfin]. specialize (Hfin Hnf). lia.
Qed.

(** **What keeps its core is never preempted**, in an accepted table: once begun, it is on top until it ends. *)
Theorem accepted_alone : forall env late s,
  0 <= late -> punctual tb env late -> run tb env initial s ->
  forall k n, (k < cores tb)%nat -> s_alone (subtask_of w (entry_at w (k, n))) = true ->
  In n (map fst (stack s k)) -> exists left below, stack s k = (n, left) :: below.
Proof.
  intros env late s Hl Hpun Hrun k n Hk Ha Hin.
  apply (never_preempted tb accepted_is_right env late Hpun Hl s Hrun k n Hk); auto.
  destruct parts as (_ & _ & Hls & _). rewrite forallb_forall in Hls.
  destruct (list_ok_sound _ (Hls (list_of w k) ltac:(apply nth_In; auto))) as (_ & _ & Hs).
  destruct (Hs n) as (_ & _ & Hnp). apply Hnp. exact Ha.
Qed.

End Accepted.




(** * Theorem T: in a right table nothing comes later than in the table *)

From Coq Require Import ZArith List Bool Lia.
From Table Require Import Model.
Import ListNotations.
Open Scope Z_scope.

Section Table.
Variable tb : table.

(** WCETs of [n] entries of core [k] from index [i] on. *)
Fixpoint work (k i n : nat) : Z :=
  match n with O => 0 | S m => wcet tb (k, i) + work k (S i) m end.

(** [encloses k x i n]: the family of [x], which is [x] and what directly follows with a larger depth, ends before
    index [i + n] (in a plain list it is [x] alone); the entry there does not start in the table before [x] is finished. *)
Definition encloses (k x i n : nat) : Prop :=
  ((forall j, (x < j < i + n)%nat -> depth tb (k, x) < depth tb (k, j)) /\
   depth tb (k, (i + n)%nat) <= depth tb (k, x) \/ plain tb k /\ n = O) /\
  finish tb (k, x) <= start tb (k, (i + n)%nat).

(** The conditions on a table, as far as the theorem needs them.
    - [sorted], [family] are C3 and C4 of Conditions.v, but weaker: a finish may be later than start + WCETs of the family;
      nothing is said of the number of entries that are open.
    - [precedence] is C2. Its last part follows from a WCET of 1 or more; with WCETs of 0 it is a condition of its own.
    - [ready] is C1 without the deadline. *)
Record fits : Prop := {
  wcets : forall p, (fst p < cores tb)%nat -> 0 <= wcet tb p;
  sorted : forall k i, (k < cores tb)%nat -> start tb (k, i) <= start tb (k, S i);
  family : forall k x, (k < cores tb)%nat -> exists n, encloses k x (S x) n /\
    start tb (k, x) + wcet tb (k, x) + work k (S x) n <= finish tb (k, x);
  precedence : forall p y, (fst y < cores tb)%nat -> before tb p y ->
    (fst p < cores tb)%nat /\ 0 <= wait tb p y /\ finish tb p + wait tb p y <= start tb y /\ start tb p < start tb y
}.

Record right : Prop := {
  in_order :> fits;
  zero : forall k, (k < cores tb)%nat -> 0 <= start tb (k, O);
  ready : forall p, (fst p < cores tb)%nat -> release tb p <= start tb p
}.

(** The stack of core [k], at time [b] of the table, with the next entry at index [i]: what is left of each entry and of all
    that is, or may come, on top of it, fits until its finish in the table. *)
Fixpoint good (k i : nat) (b : Z) (st : list (nat * Z)) : Prop :=
  match st with
  | [] => True
  | (x, w) :: below =>
      0 <= w /\ (x < i)%nat /\
      (exists n, encloses k x i n /\ b + w + work k i n <= finish tb (k, x)) /\
      Forall (fun e => (fst e < x)%nat /\ depth tb (k, fst e) < depth tb (k, x)) below /\
      good k i (b + w) below
  end.

(** The lists are at most [late] behind the table. *)
Definition lists_on_time (late : Z) (s : state) : Prop :=
  forall k, (k < cores tb)%nat ->
    now s - late <= start tb (next s k) /\ good k (position s k) (now s - late) (stack s k).

(** What has ended, did so in time for the waits of what has not started. *)
Definition waits_on_time (late : Z) (s : state) : Prop :=
  forall p y, (fst y < cores tb)%nat -> before tb p y -> finished s p -> ~ started s y ->
    ended s p + wait tb p y <= start tb y + late.

Definition on_time (late : Z) (s : state) : Prop := lists_on_time late s /\ waits_on_time late s.

Hypothesis table_fits : fits.

Lemma sorted_from : forall k i n, (k < cores tb)%nat -> start tb (k, i) <= start tb (k, (i + n)%nat).
Proof.
  intros k i n Hk; induction n.
  - rewrite Nat.add_0_r; lia.
  - rewrite Nat.add_succ_r. pose proof (sorted table_fits k (i + n) Hk). lia.
Qed.

Lemma good_earlier : forall k i st b b', b' <= b -> good k i b st -> good k i b' st.
Proof.
  intros k i st; induction st as [|[x w] st IH]; simpl; intros b b' Hb; auto.
  intros (Hw & Hx & (n & He & Hn) & Hf & Hg). repeat split; auto.
  - exists n; split; auto; lia.
  - apply (IH (b + w)); auto; lia.
Qed.

(** The depths of a stack fall from its top, so what has room on the top has room on all of it. *)
Lemma room_on_all : forall k i b st d,
  good k i b st ->
  match st with [] => True | (x, _) :: _ => depth tb (k, x) < d end ->
  Forall (fun e => depth tb (k, fst e) < d) st.
Proof.
  intros k i b [|[x w] st] d Hg Hd; constructor; simpl; auto.
  destruct Hg as (_ & _ & _ & Hf & _). eapply Forall_impl; [|exact Hf]. simpl; intros; lia.
Qed.

(** The next entry is begun: its WCET moves from what may come to what is on the stack. *)
Lemma good_start : forall k i st b,
  good k i b st -> Forall (fun e => depth tb (k, fst e) < depth tb (k, i)) st ->
  good k (S i) (b + wcet tb (k, i)) st.
Proof.
  intros k i st; induction st as [|[x w] st IH]; intros b Hg Hd; simpl; auto.
  destruct Hg as (Hw & Hx & (n & ([[Hin Hout]|[Hplain _]] & Hfin) & Hn) & Hf & Hg);
    inversion Hd as [|? ? Hxi Hd']; subst; simpl in Hxi; [|specialize (Hplain x i); lia].
  assert (Hm : exists m, n = S m).
  { destruct n as [|m]; [exfalso|eauto]. rewrite Nat.add_0_r in Hout. lia. }
  destruct Hm as [m ->].
  repeat split; auto.
  - exists m. rewrite Nat.add_succ_r in *. simpl in Hn. unfold encloses.
    change (S i + m)%nat with (S (i + m)). split; [split; auto|]; lia.
  - replace (b + wcet tb (k, i) + w) with ((b + w) + wcet tb (k, i)) by lia. apply IH; auto.
Qed.

(** In a plain list an entry is passed while another runs. *)
Lemma good_pass_plain : forall k i st b, (k < cores tb)%nat -> plain tb k -> good k i b st -> good k (S i) b st.
Proof.
  intros k i st; induction st as [|[x w] st IH]; intros b Hk Hp Hg; simpl; auto.
  destruct Hg as (Hw & Hx & (n & (Hin & Hfin) & Hn) & Hf & Hg). repeat split; auto.
  exists O. assert (n = O) as ->.
  { destruct Hin as [[Hin _]|[_ ?]]; auto. destruct n; auto. specialize (Hin i ltac:(lia)). specialize (Hp x i). lia. }
  simpl in *. rewrite Nat.add_0_r in *. split; [|lia]. split; [auto|]. rewrite Nat.add_0_r.
  pose proof (sorted table_fits k i Hk). lia.
Qed.

Lemma good_end : forall k i above x w below b,
  good k i b (above ++ (x, w) :: below) -> good k i b (above ++ below).
Proof.
  intros k i above; induction above as [|[y v] above IH]; simpl; intros x w below b.
  - intros (Hw & _ & _ & _ & Hg). apply good_earlier with (b + w); auto; lia.
  - intros (Hv & Hy & Hn & Hf & Hg). repeat split; auto.
    + apply Forall_app in Hf as [Ha Hb]. inversion Hb; subst. apply Forall_app; auto.
    + eapply IH; eauto.
Qed.

Lemma good_exceed : forall k i above x w below b,
  good k i b (above ++ (x, w) :: below) -> good k i (b - 1) (above ++ (x, w + 1) :: below).
Proof.
  intros k i above; induction above as [|[y v] above IH]; simpl; intros x w below b.
  - intros (Hw & Hx & (n & He & Hn) & Hf & Hg). repeat split; auto; try lia.
    + exists n; split; auto; lia.
    + replace (b - 1 + (w + 1)) with (b + w) by lia; auto.
  - intros (Hv & Hy & (n & He & Hn) & Hf & Hg). repeat split; auto.
    + exists n; split; auto; lia.
    + apply Forall_app in Hf as [Ha Hb]. inversion Hb; subst. apply Forall_app; auto.
    + replace (b - 1 + v) with ((b + v) - 1) by lia. eapply IH; eauto.
Qed.

Lemma good_tick : forall k i st b,
  match st with [] => True | (_, w) :: _ => 0 < w end -> good k i b st -> good k i (b + 1) (spend st).
Proof.
  intros k i [|[x w] st] b; simpl; auto.
  intros Hw (_ & Hx & (n & He & Hn) & Hf & Hg). repeat split; auto; try lia.
  - exists n; split; auto; lia.
  - replace (b + 1 + (w - 1)) with (b + w) by lia; auto.
Qed.

Lemma work_nonneg : forall k n i, (k < cores tb)%nat -> 0 <= work k i n.
Proof.
  intros k n; induction n; simpl; intros i Hk; try lia.
  pose proof (wcets table_fits (k, i) Hk). specialize (IHn (S i) Hk). lia.
Qed.

(** What is on the stack leaves time for itself and for what runs. *)
Lemma good_in : forall k i st b y, (k < cores tb)%nat ->
  good k i b st -> In y (map fst st) ->
  b + match st with [] => 0 | (_, w) :: _ => w end <= finish tb (k, y) /\ b <= finish tb (k, y) /\
  (y < i)%nat /\ exists n, encloses k y i n.
Proof.
  intros k i st; induction st as [|[x w] st IH]; intros b y Hk Hg Hy; [contradiction|].
  destruct Hg as (Hw & Hx & (n & He & Hn) & Hf & Hg).
  pose proof (work_nonneg k n i Hk).
  destruct Hy as [<-|Hy]; simpl.
  - split; [lia|split; [lia|split; [lia|eauto]]].
  - destruct (IH (b + w) y Hk Hg Hy) as (_ & H1 & H2 & H3). split; [lia|split; [lia|split; auto]].
Qed.

Section Run.
Variable env : environment.

(** What is about to fall behind has been released, or is void. *)
Definition released_by (d : Z) (s : state) : Prop := forall k, (k < cores tb)%nat -> start tb (next s k) <= now s - d ->
  released env (next s k) (now s) = true \/ release tb (next s k) <= now s /\ void env (next s k) (now s) = true.

(** The heart of the proof: if time may go on, no list is about to fall behind. *)
Lemma quiet_ahead : forall s d, released_by d s -> on_time d s -> quiet tb env s ->
  forall k, (k < cores tb)%nat -> now s - d < start tb (next s k).
Proof.
  intros s d Hd [Hot Hwaits] Hq k Hk.
  destruct (Hot k Hk) as [Hs Hg].
  destruct (Z_lt_ge_dec (now s - d) (start tb (next s k))) as [|Hge]; auto.
  exfalso. assert (Heq : start tb (next s k) = now s - d) by lia. clear Hge Hs.
  destruct (Hq k Hk) as [Hnd Htop]. apply Hnd. split.
  - (* the top of the stack has a smaller depth: else its finish in the table is not after this start *)
    unfold room. destruct (stack s k) as [|[x w] st] eqn:E; auto.
    destruct (Z_lt_ge_dec (depth tb (k, x)) (depth tb (next s k))) as [|Hge]; auto. exfalso.
    destruct Hg as (Hw & Hx & (n & (Hin & Hfin) & Hn) & _).
    pose proof (work_nonneg k n (position s k) Hk).
    destruct n as [|n].
    + rewrite Nat.add_0_r in Hfin. unfold next in Heq. lia.
    + destruct Hin as [[Hin _]|[_ ?]]; [|discriminate]. assert (depth tb (k, x) < depth tb (k, position s k)) by (apply Hin; lia).
      unfold next in Hge. lia.
  - (* it is released or void, and what it waits for has ended *)
    destruct (Hd k Hk ltac:(lia)) as [Hrel|Hv]; [right|left; tauto].
    split; auto. intros [kp n] Hb.
    destruct (precedence table_fits _ (next s k) Hk Hb) as (Hkp & Hw0 & Hfs & Hss). simpl in Hkp.
    destruct (Hot kp Hkp) as [Hs' Hg']. destruct (Hq kp Hkp) as [_ Htop'].
    assert (Hst : (n < position s kp)%nat).
    { destruct (Nat.lt_ge_cases n (position s kp)) as [|Hge]; auto. exfalso.
      pose proof (sorted_from kp (position s kp) (n - position s kp) Hkp) as Hm.
      replace (position s kp + (n - position s kp))%nat with n in Hm by lia.
      unfold next in Hs' at 1. lia. }
    assert (Hfin : finished s (kp, n)).
    { split; auto. simpl. intros Hin.
      destruct (good_in _ _ _ _ _ Hkp Hg' Hin) as (Hfit & _).
      destruct (stack s kp) as [|[x w] st]; [contradiction|]. lia. }
    split; auto. assert (ended s (kp, n) + wait tb (kp, n) (next s k) <= start tb (next s k) + d); [|lia].
    apply Hwaits; auto. unfold started; simpl; lia.
Qed.

Lemma set_same : forall A (f : nat -> A) k a, set f k a k = a.
Proof. intros; unfold set; rewrite Nat.eqb_refl; auto. Qed.

Lemma set_other : forall A (f : nat -> A) k j a, j <> k -> set f k a j = f j.
Proof. intros; unfold set; apply Nat.eqb_neq in H; rewrite H; auto. Qed.

Lemma step_lists_on_time : forall s t d, released_by d s -> on_time d s -> step tb env s t ->
  lists_on_time (d + (lost t - lost s)) t.
Proof.
  intros s t d Hd Hon Hst. destruct Hon as [Hot Hwaits] eqn:E; clear E.
  inversion Hst; subst; intros j Hj; destruct (Hot j Hj) as [Hs Hg];
    unfold next; simpl; try rewrite Z.sub_diag; try rewrite Z.add_0_r.
  - destruct (Nat.eq_dec j k) as [->|Hjk].
    + rewrite !set_same. pose proof (sorted table_fits k (position s k) Hj) as Hsort.
      unfold next in Hs. split; [lia|].
      pose proof (room_on_all _ _ _ _ (depth tb (next s k)) Hg H0) as Hroom.
      destruct (family table_fits k (position s k) Hj) as (n & He & Hn).
      simpl. repeat split; auto.
      * apply (wcets table_fits (k, position s k) Hj).
      * exists n; split; auto. unfold next in *. lia.
      * assert (Hlt : Forall (fun e => (fst e < position s k)%nat) (stack s k)).
        { clear - Hg. revert Hg. generalize (now s - d).
          induction (stack s k) as [|[x w] st IH]; simpl; intros b Hg; constructor; simpl; [tauto|].
          apply (IH (b + w)); tauto. }
        rewrite Forall_forall in *. intros x Hx. split; [apply Hlt; auto|apply (Hroom x Hx)].
      * unfold next in *. replace (now s - d + wcet tb (k, position s k))
          with ((now s - d) + wcet tb (k, position s k)) by lia.
        apply good_start; auto.
    + rewrite !set_other by auto. split; auto.
  - destruct (Nat.eq_dec j k) as [->|Hjk].
    + rewrite !set_same. pose proof (sorted table_fits k (position s k) Hj) as Hsort.
      unfold next in Hs. split; [lia|].
      destruct H0 as [H0|Hplain]; [|apply good_pass_plain; auto].
      pose proof (room_on_all _ _ _ _ (depth tb (next s k)) Hg H0) as Hroom.
      pose proof (wcets table_fits (k, position s k) Hj) as Hc.
      apply good_earlier with (now s - d + wcet tb (k, position s k)); [lia|].
      apply good_start; auto.
    + rewrite !set_other by auto. split; auto.
  - split; [exact Hs|]. destruct (Nat.eq_dec j k) as [->|Hjk].
    + rewrite set_same. rewrite H0 in Hg. eapply good_end; eauto.
    + rewrite set_other by auto. auto.
  - replace (lost s + 1 - lost s) with 1 by lia. unfold next in Hs. split; [lia|].
    replace (now s - (d + 1)) with (now s - d - 1) by lia.
    destruct (Nat.eq_dec j k) as [->|Hjk].
    + rewrite set_same. rewrite H0 in Hg. eapply good_exceed; eauto.
    + rewrite set_other by auto. apply good_earlier with (now s - d); auto; lia.
  - pose proof (quiet_ahead s d Hd Hon H j Hj) as Hahead. unfold next in Hahead. split; [lia|].
    replace (now s + 1 - d) with (now s - d + 1) by lia.
    apply good_tick; auto. apply (proj2 (H j Hj)).
  - replace (lost s + 1 - lost s) with 1 by lia. unfold next in Hs. split; [lia|].
    replace (now s + 1 - (d + 1)) with (now s - d) by lia.
    destruct (H j) as [->|[Hw ->]]; auto.
    apply good_earlier with (now s - d + 1); [lia|]. apply good_tick; auto.
Qed.

Lemma start_finish : forall p, (fst p < cores tb)%nat -> start tb p <= finish tb p.
Proof.
  intros [k n] Hk; simpl in Hk. destruct (family table_fits k n Hk) as (m & _ & Hf).
  pose proof (work_nonneg k m (S n) Hk). pose proof (wcets table_fits (k, n) Hk). lia.
Qed.

Lemma set_place_same : forall A (f : place -> A) p a, set_place f p a p = a.
Proof. intros; unfold set_place; rewrite !Nat.eqb_refl; auto. Qed.

Lemma set_place_other : forall A (f : place -> A) p q a, q <> p -> set_place f p a q = f q.
Proof.
  intros A f [k x] [k' x'] a Hn; unfold set_place; simpl.
  destruct (Nat.eqb_spec k' k), (Nat.eqb_spec x' x); simpl; subst; auto. congruence.
Qed.

(** What is finished after a step was so before, or has ended in it, by its finish in the table. *)
Lemma step_finished : forall s t d p, on_time d s -> step tb env s t -> (fst p < cores tb)%nat -> finished t p ->
  finished s p /\ ended t p = ended s p \/ ended t p <= finish tb p + d.
Proof.
  intros s t d [kp n] [Hot _] Hst Hkp [Hs Hn]. unfold finished, started in *.
  inversion Hst; subst; simpl in *.
  - left. split; auto. destruct (Nat.eq_dec kp k) as [->|Hk].
    + rewrite set_same in Hs, Hn. simpl in Hn. split; [lia|tauto].
    + rewrite set_other in Hs, Hn by auto. auto.
  - destruct (Nat.eq_dec kp k) as [->|Hk].
    + rewrite set_same in Hs. destruct (Nat.eq_dec n (position s k)) as [->|Hne].
      * right. unfold next. rewrite set_place_same. destruct (Hot k Hkp) as [Hle _].
        pose proof (start_finish (next s k) Hkp). unfold next in *. lia.
      * left. rewrite set_place_other by (unfold next; congruence). split; auto. split; auto. lia.
    + rewrite set_other in Hs by auto. left. rewrite set_place_other by (unfold next; congruence). auto.
  - destruct (Nat.eq_dec kp k) as [->|Hk].
    + rewrite set_same in Hn. destruct (Nat.eq_dec n x) as [->|Hne].
      * right. rewrite set_place_same. destruct (Hot k Hkp) as [_ Hg].
        assert (Hin : In x (map fst (stack s k))) by (rewrite H0, map_app; simpl; apply in_or_app; simpl; auto).
        destruct (good_in _ _ _ _ _ Hkp Hg Hin) as (_ & Hle & _). lia.
      * left. rewrite set_place_other by congruence. split; auto. split; auto. rewrite H0. intros Hin. apply Hn.
        rewrite map_app in *. simpl in Hin. apply in_app_or in Hin as [?|[?|?]]; apply in_or_app; auto. congruence.
    + rewrite set_other in Hn by auto. left. rewrite set_place_other by congruence. auto.
  - left. split; auto. split; auto. destruct (Nat.eq_dec kp k) as [->|Hk].
    + rewrite set_same in Hn. rewrite H0. rewrite map_app in *. auto.
    + rewrite set_other in Hn by auto. auto.
  - left. split; auto. split; auto. destruct (stack s kp) as [|[x w] st]; auto.
  - left. split; auto. split; auto. destruct (H kp) as [E|[_ E]]; rewrite E in Hn; auto.
    destruct (stack s kp) as [|[x w] st]; auto.
Qed.

Lemma step_started : forall s t p, step tb env s t -> started s p -> started t p.
Proof.
  intros s t [kp n] Hst. unfold started; simpl. inversion Hst; subst; simpl; auto;
    (destruct (Nat.eq_dec kp k) as [->|Hk]; [rewrite set_same; lia|rewrite set_other; auto]).
Qed.

Lemma step_on_time : forall s t d, released_by d s -> on_time d s -> step tb env s t ->
  on_time (d + (lost t - lost s)) t /\ 0 <= lost t - lost s.
Proof.
  intros s t d Hd Hon Hst. assert (Hl : 0 <= lost t - lost s) by (inversion Hst; subst; simpl; lia).
  split; auto. split; [apply step_lists_on_time; auto|]. intros p y Hy Hb Hf Hns.
  destruct (precedence table_fits p y Hy Hb) as (Hp & Hw & Hfs & _).
  destruct (step_finished s t d p Hon Hst Hp Hf) as [[Hf' ->]|He]; [|lia].
  assert (ended s p + wait tb p y <= start tb y + d); [|lia].
  apply (proj2 Hon); auto. intros Hs. apply Hns. eapply step_started; eauto.
Qed.

(** When nothing is open on any core, no start has been missed, and no pending wait ends too late, all is on time, whatever was
    before. (It is not enough that what should have started and finished by now has done so: Counterexamples.v.) *)
Lemma idle_on_time : forall d s,
  (forall k, (k < cores tb)%nat -> stack s k = [] /\ now s <= start tb (next s k) + d) -> waits_on_time d s ->
  on_time d s.
Proof. intros d s Hi Hw. split; auto. intros k Hk. destruct (Hi k Hk) as [-> Hs]. split; [lia|simpl; auto]. Qed.

(** What [on_time] says of one entry. *)
Lemma on_time_bounds : forall d s p, on_time d s -> (fst p < cores tb)%nat ->
  (~ started s p -> now s <= start tb p + d) /\ (~ finished s p -> now s <= finish tb p + d).
Proof.
  intros d s [k n] [Hot _] Hk. simpl in Hk. destruct (Hot k Hk) as [Hs Hg].
  assert (H1 : ~ started s (k, n) -> now s <= start tb (k, n) + d).
  { unfold started; simpl; intros Hn.
    pose proof (sorted_from k (position s k) (n - position s k) Hk) as Hm.
    replace (position s k + (n - position s k))%nat with n in Hm by lia. unfold next in Hs. lia. }
  split; auto. intros Hn.
  destruct (family table_fits k n Hk) as (m & _ & Hf).
  pose proof (work_nonneg k m (S n) Hk). pose proof (wcets table_fits (k, n) Hk).
  destruct (Nat.lt_ge_cases n (position s k)) as [Hlt|Hge].
  - destruct (in_dec Nat.eq_dec n (map fst (stack s k))) as [Hin|Hnin].
    + destruct (good_in _ _ _ _ _ Hk Hg Hin) as (_ & Hfin & _). lia.
    + exfalso. apply Hn. split; auto.
  - assert (now s <= start tb (k, n) + d) by (apply H1; unfold started; simpl; lia). lia.
Qed.

End Run.
End Table.

Section Right.
Variable tb : table.
Hypothesis table_is_right : right tb.
Variables (env : environment) (late : Z).
Hypothesis environment_is_punctual : punctual tb env late.
Hypothesis late_nonneg : 0 <= late.

(** **Theorem T with losses.** From an instant at which all lists are at most [d] behind (and releases at most [late <= d]),
    after any run all lists are at most [d] behind, plus what was lost since then. *)
Theorem stays_on_time : forall s t d, late <= d -> on_time tb d s -> run tb env s t ->
  on_time tb (d + (lost t - lost s)) t /\ 0 <= lost t - lost s.
Proof.
  intros s t d Hd Hot Hrun. induction Hrun as [s|s t u Hrun IH Hstep].
  - rewrite Z.sub_diag, Z.add_0_r. split; auto; lia.
  - destruct (IH Hot) as [IHo IHn].
    destruct (step_on_time tb table_is_right env t u (d + (lost t - lost s))) as [H1 H2]; auto.
    + intros k Hk Hs. pose proof (ready tb table_is_right (next t k) Hk).
      destruct (environment_is_punctual (next t k) (now t) Hk ltac:(lia)); [left|right; split; [lia|]]; auto.
    + split; [|lia]. replace (d + (lost u - lost s)) with (d + (lost t - lost s) + (lost u - lost t)) by lia. auto.
Qed.

Lemma initial_on_time : on_time tb late initial.
Proof.
  split.
  - intros k Hk. split; simpl; auto. pose proof (zero tb table_is_right k Hk). unfold next; simpl. lia.
  - intros p y _ _ [Hs _]. unfold started in Hs; simpl in Hs. lia.
Qed.

(** **Theorem T (sustainable).** In a right table, with releases at most [late] late, in every run: while an entry has not started
    (nor was passed), it is not later than its start in the table, plus [late], plus what was lost; while it is not
    finished, not later than its finish, plus the same. So nothing starts or finishes later than that, whatever ends
    early, is skipped or cut. Left out: members, and how a table is made. *)
Theorem sustainable : forall s, run tb env initial s ->
  forall p, (fst p < cores tb)%nat ->
  (~ started s p -> now s <= start tb p + late + lost s) /\
  (~ finished s p -> now s <= finish tb p + late + lost s).
Proof.
  intros s Hrun p Hp.
  destruct (stays_on_time initial s late) as [Hot _]; auto; try lia.
  { apply initial_on_time. }
  simpl in Hot. rewrite Z.sub_0_r in Hot.
  destruct (on_time_bounds tb table_is_right _ _ p Hot Hp). split; intros; [specialize (H H1)|specialize (H0 H1)]; lia.
Qed.

(** **An entry with an empty family is never preempted** (what an np DAG needs): when it has begun and not ended, it is the
    top of its core's stack. *)
Theorem never_preempted : forall s, run tb env initial s ->
  forall k n, (k < cores tb)%nat -> depth tb (k, S n) <= depth tb (k, n) ->
  In n (map fst (stack s k)) -> exists w below, stack s k = (n, w) :: below.
Proof.
  intros s Hrun k n Hk Hd Hin.
  destruct (stays_on_time initial s late) as [Hot _]; auto; try lia.
  { apply initial_on_time. }
  destruct (proj1 Hot k Hk) as [_ Hg]. revert Hg.
  generalize (now s - (late + (lost s - lost initial))). intros b Hg.
  destruct (good_in tb table_is_right _ _ _ _ _ Hk Hg Hin) as (_ & _ & Hlt & m & (Hbetween & _)).
  destruct (stack s k) as [|[x w] st]; [contradiction|].
  destruct Hin as [Heq|Hin]; simpl in *; [subst; eauto|]. exfalso.
  destruct Hg as (_ & Hx & _ & Hf & _).
  assert (Hnx : (n < x)%nat /\ depth tb (k, n) < depth tb (k, x)).
  { apply in_map_iff in Hin as ([y v] & Hy & Hin). simpl in Hy; subst.
    rewrite Forall_forall in Hf. apply (Hf (n, v) Hin). }
  destruct Hnx as [Hnx Hdx].
  destruct Hbetween as [[Hbetween _]|[Hplain _]]; [|specialize (Hplain n x); lia].
  assert (depth tb (k, n) < depth tb (k, S n)) by (apply Hbetween; lia). lia.
Qed.

End Right.

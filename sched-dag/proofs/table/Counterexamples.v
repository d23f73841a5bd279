(** * Where less does not suffice: two counterexamples

    1. With WCETs of 0, C1 to C4 (Conditions.v) do not suffice: the lists can wait for each other for ever.
    2. "All lists are on time" cannot be read off from what should have started and finished by now: nothing need be late, and
       an entry is late after all, without any overrun since. *)

From Coq Require Import ZArith List Bool Lia Arith.
From Table Require Import Model Sustainable.
Import ListNotations.
Open Scope Z_scope.

(** All is released at its nominal time or before; nothing is void. *)
Definition always : environment := {| released := fun _ _ => true; void := fun _ _ => false |}.

(** ** 1. WCETs of 0

    One core, one DAG with subtasks 0 and 1 of WCET 0, an edge from 1 to 0, period 10; the list is 0, 1. All starts and
    finishes are those of the release, so C1 to C4 hold. But subtask 0 waits for 1, which comes after 0 in the list. *)
Definition zero : table := {|
  cores := 1;
  wcet := fun _ => 0;
  start := fun p => 10 * Z.of_nat (snd p / 2);
  finish := fun p => 10 * Z.of_nat (snd p / 2);
  release := fun p => 10 * Z.of_nat (snd p / 2);
  depth := fun _ => 0;
  before := fun p y => fst p = O /\
    (snd p = S (snd y) /\ Nat.even (snd y) = true \/ snd y = S (S (snd p)));
  wait := fun _ _ => 0
|}.

(** C1 to C4, each as in Conditions.v, hold; only WCETs are 0. *)
Theorem zero_meets_conditions :
  (forall p, (fst p < cores zero)%nat -> 0 <= wcet zero p) /\
  (forall k, 0 <= start zero (k, O)) /\
  (forall k i, start zero (k, i) <= start zero (k, S i)) /\
  (forall p, release zero p <= start zero p) /\
  (forall p y, before zero p y -> (fst p < cores zero)%nat /\ finish zero p <= start zero y) /\
  (forall k x y, (x < y)%nat -> start zero (k, y) < finish zero (k, x) -> depth zero (k, x) < depth zero (k, y)) /\
  (forall k x, exists n,
    (forall j, (x < j < S x + n)%nat -> depth zero (k, x) < depth zero (k, j)) /\
    depth zero (k, (S x + n)%nat) <= depth zero (k, x) /\
    finish zero (k, x) - start zero (k, x) = wcet zero (k, x) + work zero k (S x) n).
Proof.
  assert (M : forall x y, (x <= y)%nat -> 10 * Z.of_nat (x / 2) <= 10 * Z.of_nat (y / 2)).
  { intros x y Hxy. pose proof (Nat.div_le_mono x y 2 ltac:(lia) Hxy). lia. }
  cbn [cores wcet start finish release depth before zero].
  split; [intros; lia|]. split; [intros; simpl; lia|]. split; [intros; apply M; simpl; lia|]. split; [intros; lia|].
  split; [|split].
  - intros [k n] [k' i] (Hk & Hni); cbn [fst snd] in *. split; [lia|]. destruct Hni as [[-> He]| ->]; [|apply M; lia].
    apply Nat.even_spec in He as [m ->]. replace (S (2 * m)) with (1 + m * 2)%nat by lia.
    rewrite (Nat.mul_comm 2 m), Nat.div_add, Nat.div_mul by lia. change (1 / 2)%nat with O. lia.
  - intros k x y Hxy Hlt. specialize (M x y ltac:(lia)). cbn [snd] in Hlt. lia.
  - intros k x. exists O. split; [intros; lia|]. split; [lia|]. cbn [work]. lia.
Qed.

(** Yet nothing ever starts: time goes on by the rules, and the first entry is not finished. *)
Theorem zero_is_stuck : forall t, 0 <= t -> exists s, run zero always initial s /\ now s = t /\ ~ started s (O, O).
Proof.
  intros t Ht. pattern t. apply natlike_ind; auto.
  - exists initial. repeat split; [constructor|]. unfold started; simpl; lia.
  - intros x Hx (s & Hr & Hn & Hs).
    assert (Hp : position s O = O) by (unfold started in Hs; simpl in Hs; lia).
    assert (Hq : stack s O = [] -> quiet zero always s).
    { intros He [|k] Hk; simpl in Hk; [|lia]. rewrite He. split; auto.
      intros (_ & [(_ & Hv)|(_ & Hb)]); [discriminate|].
      destruct (Hb (O, 1%nat)) as ((Hst & _) & _).
      - simpl. rewrite Hp. auto.
      - unfold started in Hst; simpl in Hst. lia. }
    exists {| now := now s + 1; lost := lost s; position := position s; stack := fun k => spend (stack s k);
              ended := ended s |}.
    split; [|split; [simpl; lia|exact Hs]].
    apply Go with s; auto. apply Tick, Hq.
    (* nothing has started, so nothing is on the stack *)
    clear - Hr Hp. assert (I : forall s, run zero always initial s ->
      Forall (fun e => (fst e < position s O)%nat) (stack s O)).
    { clear. intros u Hu. remember initial as i. induction Hu as [|i u v Hu IH Hst]; subst; [constructor|].
      specialize (IH eq_refl). destruct Hst; simpl in *.
      - destruct k; [|lia]. rewrite !set_same. constructor; simpl; [lia|].
        eapply Forall_impl; [|exact IH]. simpl; intros; lia.
      - destruct k; [|lia]. rewrite !set_same. eapply Forall_impl; [|exact IH]. simpl; intros; lia.
      - destruct k; [|lia]. rewrite !set_same. rewrite H0 in IH.
        apply Forall_app in IH as [Ha Hb]. inversion Hb; subst. apply Forall_app; auto.
      - destruct k; [|lia]. rewrite !set_same. rewrite H0 in IH.
        apply Forall_app in IH as [Ha Hb]. inversion Hb; subst. apply Forall_app; split; auto.
      - destruct (stack s O) as [|[x w] st]; simpl in *; auto. inversion IH; subst. constructor; auto.
      - destruct (H O) as [->|[_ ->]]; auto.
        destruct (stack s O) as [|[x w] st]; simpl in *; auto. inversion IH; subst. constructor; auto. }
    specialize (I s Hr). rewrite Hp in I. destruct (stack s O) as [|e st]; auto.
    inversion I; subst. lia.
Qed.

(** ** 2. "On time"

    One core. Entry x (WCET 9, 0 to 10, depth 0), nested in it y (WCET 1, 1 to 2, depth 1), then z (20 to 21), and so on. y takes 3
    more than its WCET. At 6, all that should have started by 6 has started, all that should have finished by 6 is finished,
    and no entry that is open started late. From 6 on nothing exceeds its WCET. But x is not finished at 12, after its 10. *)
Definition nest : table := {|
  cores := 1;
  wcet := fun p => match snd p with O => 9 | _ => 1 end;
  start := fun p => match snd p with O => 0 | S O => 1 | S (S n) => 20 + 10 * Z.of_nat n end;
  finish := fun p => match snd p with O => 10 | S O => 2 | S (S n) => 21 + 10 * Z.of_nat n end;
  release := fun p => match snd p with O => 0 | S O => 1 | S (S n) => 20 + 10 * Z.of_nat n end;
  depth := fun p => match snd p with S O => 1 | _ => 0 end;
  before := fun _ _ => False;
  wait := fun _ _ => 0
|}.

Local Opaque Z.mul Z.add.

Theorem nest_is_right : right nest.
Proof.
  constructor; [constructor| |]; simpl; try tauto; try lia.
  - intros [k [|n]] _; simpl; lia.
  - intros k [|[|n]] _; simpl; lia.
  - intros k [|[|x]] _.
    + exists 1%nat. unfold encloses; simpl. split; [split; [left; split|]|]; try lia.
      intros [|[|j]] Hj; simpl; lia.
    + exists O. unfold encloses; simpl. split; [split; [left; split|]|]; try lia.
    + exists O. unfold encloses; simpl. split; [split; [left; split|]|]; try lia.
Qed.

Local Transparent Z.mul Z.add.

(** Releases at the nominal times. *)
Definition nominal : environment := {| released := fun p t => release nest p <=? t; void := fun _ _ => false |}.

(** The state at time [t], with the next index [i], the stack [st], and [o] of overruns. *)
Definition at_ (t o : Z) (i : nat) (st : list (nat * Z)) (s : state) : Prop :=
  now s = t /\ lost s = o /\ position s O = i /\ stack s O = st.

Lemma quiet_when : forall s i st t o, at_ t o i st s ->
  t < release nest (O, i) -> match st with [] => True | (_, w) :: _ => 0 < w end -> quiet nest nominal s.
Proof.
  intros s i st t o (<- & _ & <- & <-) Hr Hw [|k] Hk; simpl in Hk; [|lia]. split; auto.
  intros (_ & [(_ & Hv)|(Hrel & _)]); [discriminate|]. simpl in Hrel. apply Z.leb_le in Hrel.
  unfold next in Hrel. simpl in Hr. lia.
Qed.

Lemma go_tick : forall s0 s t o i st, at_ t o i st s -> run nest nominal s0 s ->
  t < release nest (O, i) -> match st with [] => True | (_, w) :: _ => 0 < w end ->
  exists s', run nest nominal s0 s' /\ at_ (t + 1) o i (spend st) s'.
Proof.
  intros s0 s t o i st Ha Hr Ht Hw. eexists. split.
  - eapply Go; [exact Hr|]. apply Tick. eapply quiet_when; eauto.
  - destruct Ha as (<- & <- & <- & <-). repeat split.
Qed.

Lemma go_start : forall s0 s t o i st, at_ t o i st s -> run nest nominal s0 s ->
  match st with [] => True | (x, _) :: _ => depth nest (O, x) < depth nest (O, i) end ->
  exists s', run nest nominal s0 s' /\ at_ t o (S i) ((i, wcet nest (O, i)) :: st) s'.
Proof.
  intros s0 s t o i st Ha Hr Hroom. eexists. split.
  - eapply Go; [exact Hr|]. apply (Start nest nominal s O); [simpl; lia|].
    destruct Ha as (_ & _ & Hi & Hst). unfold room, next. rewrite Hst, Hi. exact Hroom.
  - destruct Ha as (<- & <- & <- & <-). repeat split.
Qed.

Lemma go_exceed : forall s0 s t o i x w st, at_ t o i ((x, w) :: st) s -> run nest nominal s0 s ->
  exists s', run nest nominal s0 s' /\ at_ t (o + 1) i ((x, w + 1) :: st) s'.
Proof.
  intros s0 s t o i x w st Ha Hr. eexists. split.
  - eapply Go; [exact Hr|]. apply (Exceed nest nominal s O [] x w st); [simpl; lia|].
    destruct Ha as (_ & _ & _ & Hst). exact Hst.
  - destruct Ha as (<- & <- & <- & Hst). repeat split.
Qed.

Lemma go_end : forall s0 s t o i x w st, at_ t o i ((x, w) :: st) s -> run nest nominal s0 s ->
  exists s', run nest nominal s0 s' /\ at_ t o i st s'.
Proof.
  intros s0 s t o i x w st Ha Hr. eexists. split.
  - eapply Go; [exact Hr|]. apply (End nest nominal s O [] x w st); [simpl; lia|].
    destruct Ha as (_ & _ & _ & Hst). exact Hst.
  - destruct Ha as (<- & <- & <- & Hst). repeat split.
Qed.

Ltac after_top L := match goal with
  | Ha : at_ _ _ _ _ ?s, Hr : run _ _ _ ?s |- _ =>
      let s' := fresh "s" in let Hr' := fresh "Hr" in let Ha' := fresh "Ha" in
      destruct (L _ _ _ _ _ _ _ _ Ha Hr) as (s' & Hr' & Ha'); clear Ha Hr; simpl in Ha'
  end.
Ltac tick := match goal with
  | Ha : at_ _ _ _ _ ?s, Hr : run _ _ _ ?s |- _ =>
      let s' := fresh "s" in let Hr' := fresh "Hr" in let Ha' := fresh "Ha" in
      destruct (go_tick _ _ _ _ _ _ Ha Hr) as (s' & Hr' & Ha'); [simpl; lia | simpl; lia |]; clear Ha Hr; simpl in Ha'
  end.
Ltac begin := match goal with
  | Ha : at_ _ _ _ _ ?s, Hr : run _ _ _ ?s |- _ =>
      let s' := fresh "s" in let Hr' := fresh "Hr" in let Ha' := fresh "Ha" in
      destruct (go_start _ _ _ _ _ _ Ha Hr) as (s' & Hr' & Ha'); [simpl; try exact I; lia |]; clear Ha Hr; simpl in Ha'
  end.

Theorem on_time_by_the_clock_is_not_enough : exists s6 s12,
  run nest nominal initial s6 /\ run nest nominal s6 s12 /\
  now s6 = 6 /\ now s12 = 12 /\ lost s12 = lost s6 /\
  (forall p, (fst p < cores nest)%nat -> start nest p <= now s6 -> started s6 p) /\
  (forall p, (fst p < cores nest)%nat -> finish nest p <= now s6 -> finished s6 p) /\
  finish nest (O, O) = 10 /\ ~ finished s12 (O, O).
Proof.
  assert (exists s6, run nest nominal initial s6 /\ at_ 6 3 2 [(O, 7)] s6) as (s6 & R6 & H6).
  { assert (Ha : at_ 0 0 0 [] initial) by (repeat split).
    assert (Hr : run nest nominal initial initial) by constructor.
    begin. tick. begin. do 3 after_top go_exceed. do 4 tick. after_top go_end. tick. eauto. }
  assert (exists s12, run nest nominal s6 s12 /\ at_ 12 3 2 [(O, 1)] s12) as (s12 & R12 & H12).
  { assert (Ha := H6). assert (Hr : run nest nominal s6 s6) by constructor. clear R6 H6.
    do 6 tick. eauto. }
  exists s6, s12. destruct H6 as (N6 & O6 & P6 & S6), H12 as (N12 & O12 & P12 & S12).
  repeat (split; [solve [auto | congruence | lia]|]).
  split; [|split; [|split]].
  - intros [[|k] n] Hk Hs; simpl in Hk; [|lia]. unfold started; simpl. rewrite N6 in Hs. rewrite P6.
    destruct n as [|[|n]]; cbn [start nest snd] in Hs; lia.
  - intros [[|k] n] Hk Hs; simpl in Hk; [|lia]. unfold finished, started; simpl. rewrite N6 in Hs. rewrite P6, S6.
    destruct n as [|[|n]]; cbn [finish nest snd map fst In] in *; lia.
  - reflexivity.
  - unfold finished; simpl. rewrite S12. simpl. tauto.
Qed.




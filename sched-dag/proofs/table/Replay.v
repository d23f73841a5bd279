(** * A simulator whose runs are runs of the rules

    [replay] runs the lists of an accepted witness by the narrow rules of Exact.v, with given execution times. With WCETs, case
    t000 finishes each entry exactly when its table says: the rules are not wider, nor narrower, than they should be,
    and the bounds are attained. *)

From Coq Require Import ZArith List Bool Lia Arith.
From Table Require Import Model Sustainable Checker CheckerProof Exact Cases.
Import ListNotations.
Open Scope Z_scope.

Section Replay.
Variable w : witness.
Let tb := table_of w.

(** Releases at the nominal times; what is before a DAG's first job does not exist; no waits. *)
Definition nominal_times : environment := {|
  released := fun p t => release tb p <=? t;
  void := fun p _ => job_at w p <? d_offset (dag_of w (entry_at w p)) / d_period (dag_of w (entry_at w p)) |}.

Variable env : environment.

(** The execution time of each entry. *)
Variable time_of : place -> Z.
Hypothesis times : forall p, time_of p <= wcet tb p.

Definition no_pause : place -> place -> Z := fun _ _ => 0.

Definition finished_b (s : state) (p : place) : bool :=
  (snd p <? position s (fst p))%nat && negb (existsb (fun e => (fst e =? snd p)%nat) (stack s (fst p))).

Definition room_b (s : state) (k : nat) : bool :=
  match stack s k with [] => true | (x, _) :: _ => depth tb (k, x) <? depth tb (next s k) end.

Definition settled_b (s : state) (y : place) : bool :=
  forallb (fun p => finished_b s p && (ended s p + 0 <=? now s) || void env p (now s)) (waits_of w y).

(** What is to be done on core [k] at this instant. *)
Definition act (s : state) (k : nat) : option state :=
  match stack s k with
  | (x, l) :: below =>
      if l <=? wcet tb (k, x) - time_of (k, x)
      then Some {| now := now s; lost := lost s; position := position s; stack := set (stack s) k below;
                   ended := set_place (ended s) (k, x) (now s) |}
      else None
  | [] => None
  end.

Definition begin (s : state) (k : nat) : option state :=
  if negb (room_b s k) then None
  else let calls := released env (next s k) (now s) && settled_b s (next s k) in
  if void env (next s k) (now s)
  then if negb (release tb (next s k) <=? now s) && negb calls then None else Some {| now := now s; lost := lost s; position := set (position s) k (S (position s k));
               stack := stack s; ended := set_place (ended s) (next s k) (now s) |}
  else if calls
  then Some {| now := now s; lost := lost s; position := set (position s) k (S (position s k));
               stack := set (stack s) k ((position s k, wcet tb (next s k)) :: stack s k); ended := ended s |}
  else None.

Fixpoint first (f : state -> nat -> option state) (s : state) (ks : list nat) : option state :=
  match ks with [] => None | k :: ks => match f s k with Some u => Some u | None => first f s ks end end.

Definition go (s : state) : state :=
  match first act s (seq 0 (cores tb)) with
  | Some u => u
  | None => match first begin s (seq 0 (cores tb)) with
    | Some u => u
    | None => {| now := now s + 1; lost := lost s; position := position s; stack := fun k => spend (stack s k);
                 ended := ended s |}
    end
  end.

Fixpoint replay (n : nat) (s : state) : state := match n with O => s | S n => replay n (go s) end.

Lemma finished_b_spec : forall s p, finished_b s p = true <-> finished s p.
Proof.
  intros s [k n]. unfold finished_b, finished, started; simpl. rewrite andb_true_iff, Nat.ltb_lt, negb_true_iff.
  split; intros [H1 H2]; split; auto.
  - intros Hin. apply in_map_iff in Hin as (e & He & Hin). rewrite <- not_true_iff_false in H2. apply H2.
    apply existsb_exists. exists e. split; auto. apply Nat.eqb_eq; auto.
  - apply not_true_iff_false. intros E. apply existsb_exists in E as (e & Hin & He). apply Nat.eqb_eq in He.
    apply H2. apply in_map_iff. eauto.
Qed.

Lemma room_b_spec : forall s k, room_b s k = true <-> room tb s k.
Proof. intros s k. unfold room_b, room. destruct (stack s k) as [|[x l] st]; [tauto|]. apply Z.ltb_lt. Qed.

Hypothesis accepted : check w = true.

Lemma settled_b_spec : forall s y, (fst y < cores tb)%nat -> settled_b s y = true <-> settled tb env no_pause s y.
Proof.
  intros s y Hy. unfold settled_b, settled, no_pause. rewrite forallb_forall.
  split; intros A p Hp.
  - specialize (A p (proj1 (waits_listed w accepted y Hy p) Hp)).
    rewrite orb_true_iff, andb_true_iff, Z.leb_le, finished_b_spec in A. auto.
  - apply (waits_listed w accepted y Hy p) in Hp. rewrite orb_true_iff, andb_true_iff, Z.leb_le, finished_b_spec. auto.
Qed.

Lemma first_some : forall f s u ks, first f s ks = Some u -> exists k, In k ks /\ f s k = Some u.
Proof.
  intros f s u ks; induction ks as [|k ks IH]; simpl; [discriminate|].
  destruct (f s k) eqn:E; [intros [= ->]; eauto|]. intros H. destruct (IH H) as (j & Hj & Hu); eauto.
Qed.

Lemma first_none : forall f s ks, first f s ks = None -> forall k, In k ks -> f s k = None.
Proof.
  intros f s ks; induction ks as [|j ks IH]; simpl; [tauto|].
  destruct (f s j) eqn:E; [discriminate|]. intros H k [<-|Hk]; auto.
Qed.

Lemma go_is_exact : forall s, exact tb env no_pause s (go s).
Proof.
  intros s. unfold go.
  destruct (first act s (seq 0 (cores tb))) as [u|] eqn:A; [|destruct (first begin s (seq 0 (cores tb))) as [u|] eqn:B].
  - apply first_some in A as (k & Hk & Hu). apply in_seq in Hk. unfold act in Hu.
    destruct (stack s k) as [|[x l] st] eqn:E; [discriminate|].
    destruct (l <=? wcet tb (k, x) - time_of (k, x)); [|discriminate]. injection Hu as <-.
    eapply Ends; eauto. lia.
  - apply first_some in B as (k & Hk & Hu). apply in_seq in Hk. unfold begin in Hu.
    destruct (room_b s k) eqn:R; [|discriminate]. apply room_b_spec in R. simpl in Hu.
    cbv zeta in Hu. destruct (void env (next s k) (now s)) eqn:V.
    { match type of Hu with (if ?c then _ else _) = _ => destruct c end; [discriminate|].
      injection Hu as <-; apply Passes; auto; lia. }
    destruct (released env (next s k) (now s)) eqn:Rel; [|discriminate].
    destruct (settled_b s (next s k)) eqn:S; [|discriminate]. injection Hu as <-.
    apply Starts; auto; [lia|]. apply settled_b_spec; [unfold next; cbn [fst]; lia|auto].
  - apply Ticks. intros k Hk. assert (Hin : In k (seq 0 (cores tb))) by (apply in_seq; lia).
    pose proof (first_none _ _ _ A k Hin) as HA. pose proof (first_none _ _ _ B k Hin) as HB. split.
    + intros (Hroom & Hd). apply room_b_spec in Hroom. unfold begin in HB. rewrite Hroom in HB. cbn [negb] in HB.
      cbv zeta in HB. destruct Hd as [[Hl Hv]|[Hr Hs]].
      * apply Z.leb_le in Hl. rewrite Hv, Hl in HB. discriminate.
      * apply settled_b_spec in Hs; [|exact Hk]. rewrite Hr, Hs, andb_false_r in HB.
        destruct (void env (next s k) (now s)); discriminate.
    + unfold act in HA. destruct (stack s k) as [|[x l] st]; auto.
      destruct (Z.leb_spec l (wcet tb (k, x) - time_of (k, x))); [discriminate|]. pose proof (times (k, x)). lia.
Qed.

(** **What [replay] does is a run by the narrow rules**, hence by those of Model.v. *)
Theorem replay_is_run : forall n s, exact_run tb env no_pause s (replay n s).
Proof.
  induction n as [|n IH]; intros s; [constructor|]. simpl.
  eapply exact_run_trans; [|apply IH]. eapply Exact_go; [constructor|apply go_is_exact].
Qed.

(** The places of the first [n] laps. *)
Definition places (n : nat) : list place :=
  flat_map (fun k => map (pair k) (seq 0 (n * length (list_of w k)))) (seq 0 (cores tb)).

Definition on_the_dot (n : nat) (s : state) : bool :=
  forallb (fun p => finished_b s p && (ended s p =? finish tb p)) (places n).
Definition in_time (n : nat) (s : state) : bool :=
  forallb (fun p => finished_b s p && (ended s p <=? finish tb p)) (places n).

End Replay.

(** With WCETs, two laps of t000 (72 units of time): each of the 74 entries ends exactly when its table says. *)
Example t000_is_attained :
  let s := replay t000 (nominal_times t000) (wcet (table_of t000)) 300 initial in
  (72 <=? now s) && on_the_dot t000 2 s = true.
Proof. vm_cast_no_check (eq_refl true). Qed.

(** With shorter times it is, of course, in time: what Theorem T says, seen once. *)
Example t000_in_time :
  let time_of p := (wcet (table_of t000) p * Z.of_nat (S (snd p) mod 3)) / 2 in
  let s := replay t000 (nominal_times t000) (fun p => Z.min (time_of p) (wcet (table_of t000) p)) 300 initial in
  (72 <=? now s) && in_time t000 2 s && negb (on_the_dot t000 2 s) = true.
Proof. vm_cast_no_check (eq_refl true). Qed.

(** Where all DAGs have ended, time goes on. *)
Example time_goes_on_after_the_end :
  let ended := {| released := fun _ _ => false; void := fun _ _ => true |} in
  (36 <=? now (replay t000 ended (fun _ => 0) 120 initial)) = true.
Proof. vm_cast_no_check (eq_refl true). Qed.



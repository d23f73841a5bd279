(** * The rules as narrow as sched-dag/src/table.rs states them, and that they never block

    Model.v leaves much open, so that Theorem T covers many platforms. Here an entry starts only if it is released, not void,
    and all that it waits for has ended, was passed, or is void; it takes its WCET at most. Each such run is a run of
    Model.v. And from every state time can go on: the demand that nothing due be kept waiting can be met. *)

From Coq Require Import ZArith List Bool Lia Arith.
From Table Require Import Model Sustainable Checker CheckerProof.
Import ListNotations.
Open Scope Z_scope.

Section Exact.
Variable tb : table.
Variable env : environment.

(** How long [y] has to wait, in this run, after [p] has ended. *)
Variable pause : place -> place -> Z.
Hypothesis pauses : forall p y, pause p y <= wait tb p y.

(** What an entry waits for does not hold it up. *)
Definition settled (s : state) (y : place) : Prop :=
  forall p, before tb p y -> finished s p /\ ended s p + pause p y <= now s \/ void env p (now s) = true.

Definition exactly_due (s : state) (k : nat) : Prop :=
  room tb s k /\
  (release tb (next s k) <= now s /\ void env (next s k) (now s) = true \/ released env (next s k) (now s) = true /\ settled s (next s k)).

Definition exactly_quiet (s : state) : Prop :=
  forall k, (k < cores tb)%nat ->
    ~ exactly_due s k /\ match stack s k with [] => True | (_, w) :: _ => 0 < w end.

Inductive exact : state -> state -> Prop :=
| Starts : forall s k, (k < cores tb)%nat -> room tb s k ->
    void env (next s k) (now s) = false -> released env (next s k) (now s) = true -> settled s (next s k) ->
    exact s {| now := now s; lost := lost s; position := set (position s) k (S (position s k));
               stack := set (stack s) k ((position s k, wcet tb (next s k)) :: stack s k); ended := ended s |}
| Passes : forall s k, (k < cores tb)%nat -> room tb s k -> void env (next s k) (now s) = true ->
    exact s {| now := now s; lost := lost s; position := set (position s) k (S (position s k));
               stack := stack s; ended := set_place (ended s) (next s k) (now s) |}
| Ends : forall s k x w below, (k < cores tb)%nat -> stack s k = (x, w) :: below ->
    exact s {| now := now s; lost := lost s; position := position s; stack := set (stack s) k below;
               ended := set_place (ended s) (k, x) (now s) |}
| Ticks : forall s, exactly_quiet s ->
    exact s {| now := now s + 1; lost := lost s; position := position s; stack := fun k => spend (stack s k);
               ended := ended s |}.

Inductive exact_run : state -> state -> Prop :=
| Exact_stay : forall s, exact_run s s
| Exact_go : forall s t u, exact_run s t -> exact t u -> exact_run s u.

(** **The narrow rules are within those of Model.v**, so all theorems hold for them. *)
Theorem exact_is_step : forall s t, exact s t -> step tb env s t.
Proof.
  intros s t E. destruct E.
  - apply Start; auto.
  - apply Pass; auto.
  - apply (End tb env s k [] x w below); auto.
  - apply Tick. intros k Hk. destruct (H k Hk) as [Hd Hw]. split; auto.
    intros (Hroom & [[Hv Hw']|[Hr Hb]]); apply Hd; split; auto. right. split; auto. intros p Hp. left.
    destruct (Hb p Hp). split; auto. pose proof (pauses p (next s k)). lia.
Qed.

Theorem exact_run_is_run : forall s t, exact_run s t -> run tb env s t.
Proof. intros s t E; induction E; [constructor|eapply Go; eauto using exact_is_step]. Qed.

Lemma exact_run_trans : forall s t u, exact_run s t -> exact_run t u -> exact_run s u.
Proof. intros s t u E F. induction F as [|t u v F IH X]; auto. apply Exact_go with u; auto. Qed.

(** ** Time goes on *)

(** What an entry waits for can be listed. *)
Hypothesis finitely_many : forall y, (fst y < cores tb)%nat -> exists l, forall p, before tb p y <-> In p l.

(** At each time only a beginning of each list is released, or has come and is void. *)
Hypothesis beginning : forall t, exists n, forall k i, (k < cores tb)%nat -> (n <= i)%nat ->
  released env (k, i) t = false /\ (void env (k, i) t = true -> t < release tb (k, i)).

Lemma all_or_not : forall (P : place -> Prop) l, (forall p, P p \/ ~ P p) ->
  (forall p, In p l -> P p) \/ ~ (forall p, In p l -> P p).
Proof.
  intros P l D; induction l as [|a l [IH|IH]]; [left; contradiction| |].
  - destruct (D a) as [Ha|Ha]; [left|right; intros F; apply Ha, F; left; auto]. intros p [<-|Hp]; auto.
  - right. intros F. apply IH. intros p Hp. apply F. right; auto.
Qed.

Lemma one_or_none : forall (P : nat -> Prop) m, (forall k, (k < m)%nat -> P k \/ ~ P k) ->
  (exists k, (k < m)%nat /\ P k) \/ (forall k, (k < m)%nat -> ~ P k).
Proof.
  intros P m; induction m as [|m IH]; intros D; [right; lia|].
  destruct IH as [(k & Hk & Hp)|Hn]; [intros; apply D; lia|left; exists k; auto|].
  destruct (D m ltac:(lia)) as [Hp|Hp]; [left; exists m; auto|]. right. intros k Hk.
  destruct (Nat.eq_dec k m) as [->|]; auto. apply Hn; lia.
Qed.

Lemma finished_or_not : forall s p, finished s p \/ ~ finished s p.
Proof.
  intros s p. unfold finished, started.
  destruct (lt_dec (snd p) (position s (fst p))); [|tauto].
  destruct (in_dec Nat.eq_dec (snd p) (map fst (stack s (fst p)))); tauto.
Qed.

Lemma due_or_not : forall s k, (k < cores tb)%nat -> exactly_due s k \/ ~ exactly_due s k.
Proof.
  intros s k Hk. unfold exactly_due, settled.
  assert (room tb s k \/ ~ room tb s k) as [Hr|Hr].
  { unfold room. destruct (stack s k) as [|[x w] st]; auto.
    destruct (Z_lt_ge_dec (depth tb (k, x)) (depth tb (next s k))); [auto|right; lia]. }
  2: tauto.
  assert (release tb (next s k) <= now s /\ void env (next s k) (now s) = true \/
    ~ (release tb (next s k) <= now s /\ void env (next s k) (now s) = true)) as [Hv|Hv].
  { destruct (void env (next s k) (now s)), (Z_le_gt_dec (release tb (next s k)) (now s)); auto;
      right; intros [? ?]; (discriminate || lia). }
  { tauto. }
  destruct (released env (next s k) (now s)); [|right; intros (_ & [?|[? _]]); [tauto|discriminate]].
  destruct (finitely_many (next s k) Hk) as [l Hl].
  destruct (all_or_not (fun p => finished s p /\ ended s p + pause p (next s k) <= now s \/ void env p (now s) = true) l)
    as [A|A].
  - intros p. destruct (void env p (now s)); [tauto|]. destruct (finished_or_not s p);
      [|right; intros [?|?]; [tauto|discriminate]].
    destruct (Z_le_gt_dec (ended s p + pause p (next s k)) (now s)); [tauto|].
    right. intros [?|?]; [lia|discriminate].
  - left. split; auto. right. split; auto. intros p Hp. apply A, Hl; auto.
  - right. intros (_ & [?|[_ Hs]]); [tauto|]. apply A. intros p Hp. apply Hs, Hl; auto.
Qed.

Fixpoint total (f : nat -> nat) (m : nat) : nat := match m with O => O | S m => (f m + total f m)%nat end.

Lemma total_same : forall f g m, (forall j, (j < m)%nat -> f j = g j) -> total f m = total g m.
Proof. intros f g m; induction m; simpl; intros E; auto. rewrite E, IHm by (intros; auto; apply E; lia). auto. Qed.

Lemma total_less : forall f g m k, (k < m)%nat -> (f k < g k)%nat -> (forall j, j <> k -> f j = g j) ->
  (total f m < total g m)%nat.
Proof.
  intros f g m; induction m; simpl; intros k Hk Hlt E; [lia|].
  destruct (Nat.eq_dec k m) as [->|].
  - rewrite (total_same f g m) by (intros; apply E; lia). lia.
  - specialize (IHm k ltac:(lia) Hlt E). rewrite (E m) by auto. lia.
Qed.

Definition left_to_do (n : nat) (s : state) (k : nat) : nat := (2 * (n - position s k) + length (stack s k))%nat.

Lemma settles : forall n t, (forall k i, (k < cores tb)%nat -> (n <= i)%nat ->
    released env (k, i) t = false /\ (void env (k, i) t = true -> t < release tb (k, i))) ->
  forall m s, (total (left_to_do n s) (cores tb) <= m)%nat -> now s = t ->
  exists u, exact_run s u /\ now u = t /\ exactly_quiet u.
Proof.
  intros n t Hn. induction m as [m IH] using lt_wf_ind. intros s Hm Ht.
  assert (Go : forall u k, exact s u -> now u = t -> (k < cores tb)%nat ->
    (left_to_do n u k < left_to_do n s k)%nat -> (forall j, j <> k -> left_to_do n u j = left_to_do n s j) ->
    exists v, exact_run s v /\ now v = t /\ exactly_quiet v).
  { intros u k Hu Htu Hk Hlt He.
    pose proof (total_less (left_to_do n u) (left_to_do n s) (cores tb) k Hk Hlt He) as Hless.
    destruct (IH (total (left_to_do n u) (cores tb)) ltac:(lia) u ltac:(lia) Htu) as (v & Hv & Htv & Hq).
    exists v. split; auto. eapply exact_run_trans; [|exact Hv]. eapply Exact_go; [constructor|exact Hu]. }
  destruct (one_or_none (fun k => match stack s k with [] => False | (_, w) :: _ => w <= 0 end) (cores tb))
    as [(k & Hk & Hp)|Hnone].
  { intros k _. destruct (stack s k) as [|[x w] st]; [tauto|]. lia. }
  - (* something runs that has nothing left: it ends *)
    destruct (stack s k) as [|[x w] st] eqn:E; [contradiction|].
    eapply (Go _ k); [eapply Ends; eauto| |exact Hk| |]; simpl; auto; unfold left_to_do; simpl.
    + rewrite set_same, E. simpl. lia.
    + intros j Hj. rewrite set_other; auto.
  - destruct (one_or_none (exactly_due s) (cores tb)) as [(k & Hk & Hroom & Hd)|Hquiet].
    { intros; apply due_or_not; auto. }
    + (* something is due: it is passed, or starts *)
      assert (Hpos : (position s k < n)%nat).
      { destruct (Nat.lt_ge_cases (position s k) n) as [|Hge]; auto. exfalso.
        destruct (Hn k _ Hk Hge) as [Hr Hv]. rewrite <- Ht in Hr, Hv. unfold next in Hd. rewrite Hr in Hd.
        destruct Hd as [[Hle Hvo]|[? _]]; [specialize (Hv Hvo); lia|discriminate]. }
      destruct (void env (next s k) (now s)) eqn:Hv.
      * eapply (Go _ k); [eapply Passes; eauto| |exact Hk| |]; simpl; auto; unfold left_to_do; simpl.
        -- rewrite set_same. lia.
        -- intros j Hj. rewrite set_other; auto.
      * destruct Hd as [[_ ?]|[Hr Hs]]; [discriminate|].
        eapply (Go _ k); [eapply Starts; eauto| |exact Hk| |]; simpl; auto; unfold left_to_do; simpl.
        -- rewrite !set_same. simpl. lia.
        -- intros j Hj. rewrite !set_other; auto.
    + (* nothing: time may go on *)
      exists s. split; [constructor|]. split; auto. intros k Hk. split; [apply Hquiet; auto|].
      specialize (Hnone k Hk). destruct (stack s k) as [|[x w] st]; auto. lia.
Qed.

(** **The rules never block**: from any state, by the narrow rules, every later time is reached. *)
Theorem time_goes_on : forall s t, now s <= t -> exists u, exact_run s u /\ now u = t.
Proof.
  intros s t Ht. replace t with (now s + (t - now s)) by lia.
  assert (Hd : 0 <= t - now s) by lia. revert Hd. generalize (t - now s). intros d Hd. pattern d. apply natlike_ind; auto.
  - exists s. split; [constructor|lia].
  - intros x Hx (u & Hu & Hnow). destruct (beginning (now u)) as [n Hn].
    destruct (settles n (now u) Hn _ u (le_n _) eq_refl) as (v & Hv & Hnv & Hq).
    eexists. split.
    + eapply Exact_go; [eapply exact_run_trans; eauto|]. apply Ticks; auto.
    + simpl. lia.
Qed.

End Exact.

(** ** An accepted table never blocks *)

(** What the entry at [y] waits for. What starts before it is in the first laps. *)
Lemma waits_for_dec (w : witness) (p y : place) : {waits_for w p y} + {~ waits_for w p y}.
Proof.
  unfold waits_for.
  destruct (lt_dec (fst p) (length (w_lists w))); [|right; tauto].
  destruct (Nat.eq_dec (e_dag (entry_at w p)) (e_dag (entry_at w y))); [|right; tauto].
  destruct (Z.eq_dec (job_at w p) (job_at w y)), (Z.eq_dec (job_at w p) (job_at w y - 1)),
    (in_dec Nat.eq_dec (e_sub (entry_at w p)) (map fst (s_preds (subtask_of w (entry_at w y))))),
    (Nat.eq_dec (e_sub (entry_at w p)) (e_sub (entry_at w y))); (left; tauto) || (right; tauto).
Defined.

Definition waits_of (w : witness) (y : place) : list place :=
  let laps := S (Z.to_nat (start (table_of w) y / w_lap w)) in
  filter (fun p => if waits_for_dec w p y then true else false)
    (flat_map (fun k => map (pair k) (seq 0 (length (list_of w k) * laps))) (seq 0 (length (w_lists w)))).

Lemma waits_listed : forall w, check w = true -> forall y, (fst y < cores (table_of w))%nat ->
  forall p, before (table_of w) p y <-> In p (waits_of w y).
Proof.
  intros w A y Hy p. pose proof (accepted_is_right w A) as R. destruct (parts w A) as (HH & _ & Hl & _).
  rewrite forallb_forall in Hl. unfold waits_of. rewrite filter_In. split.
  2: { intros [_ Hb]. destruct (waits_for_dec w p y); [auto|discriminate]. }
  intros Hb. split; [|destruct (waits_for_dec w p y); auto].
  destruct p as [k n]. destruct (precedence _ R (k, n) y Hy Hb) as (Hk & _ & _ & Hs). simpl in Hk.
  apply in_flat_map. exists k. split; [apply in_seq; lia|]. apply in_map, in_seq. split; [lia|]. rewrite Nat.add_0_l.
  set (len := length (list_of w k)).
  assert (Hin : In (list_of w k) (w_lists w)) by (apply nth_In; auto).
  assert (Hlen : len <> O) by (specialize (Hl _ Hin); unfold len; destruct (list_of w k); simpl; [discriminate|lia]).
  assert (H0 : 0 <= e_start (entry_at w (k, n))).
  { pose proof (sorted_from _ R k 0 (n mod len) Hk) as Hm. pose proof (zero _ R k Hk) as Hz. rewrite Nat.add_0_l in Hm.
    assert (E : start (table_of w) (k, (n mod len)%nat) = e_start (entry_at w (k, n))).
    { simpl. unfold entry_at, lap_of; simpl. fold len. rewrite Nat.mod_mod by auto.
      rewrite (Nat.div_small (n mod _)) by (apply Nat.mod_upper_bound; auto). simpl. lia. }
    lia. }
  assert (Hlap : Z.of_nat (n / len) <= start (table_of w) y / w_lap w).
  { apply Z.div_le_lower_bound; [lia|]. simpl in Hs. unfold lap_of in Hs at 1. simpl in Hs. fold len in Hs.
    simpl. lia. }
  pose proof (Nat.div_mod n len Hlen). pose proof (Nat.mod_upper_bound n len Hlen). nia.
Qed.

(** **An accepted table never blocks**: if at each time only a beginning of each list is released, or has come and is void, then from
    any state the narrow rules reach every later time, also when DAGs have ended. With the bounds: every entry then is finished. *)
Theorem accepted_never_blocks : forall w, check w = true -> forall env pause,
  (forall t, exists n, forall k i, (k < cores (table_of w))%nat -> (n <= i)%nat ->
    released env (k, i) t = false /\ (void env (k, i) t = true -> t < release (table_of w) (k, i))) ->
  forall s t, now s <= t -> exists u, exact_run (table_of w) env pause s u /\ now u = t.
Proof.
  intros w A env pause B s t. apply time_goes_on; auto. intros y Hy. exists (waits_of w y). apply waits_listed; auto.
Qed.




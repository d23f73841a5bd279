(** * Time that is lost window by window, where laps begin at releases and do not overlap

    [sporadic_bounds_hold] counts all that is lost from the beginning on. Where a lap is over before the next one's release,
    whatever it lost, what was lost before a job's release is no matter to that job: if no window that is as long as its bound
    loses more than so much, it is late by so much. A platform may thus lose time for ever, as steps are long or a
    device interrupts. A window has one tick more than the bound: what is over by its bound is known to be only when its core
    has looked, which may be lost time, too.

    The proof restates the table at each release: laps that have begun are moved by what was lost since their
    releases, later ones are not, and all is on time again. *)

From Coq Require Import ZArith List Bool Lia Arith.
From Table Require Import Model Sustainable Checker CheckerProof Sporadic.
Import ListNotations.
Open Scope Z_scope.

(** A run of which [before t] is what has been lost before the instant [t]. An entry begins at its nominal release or later. *)
Inductive losing_run (tb : table) (env : environment) (before : Z -> Z) : state -> Prop :=
| Begins : before 0 = 0 -> losing_run tb env before initial
| Goes_on : forall s u, losing_run tb env before s -> step tb env s u ->
    (forall k x, In x (map fst (stack u k)) -> release tb (k, x) <= now u) ->
    before (now u) <= lost u <= before (now s + 1) ->
    losing_run tb env before u.

(** Laps are at least [gap] apart, and over when [w_lap w + loss] have gone by. *)
Definition check_losing (w : witness) (gap loss : Z) : bool :=
  check_sporadic w && forallb (forallb (fun e => e_finish e <=? w_lap w)) (w_lists w)
  && (0 <=? loss) && (w_lap w + loss <=? gap).

Lemma step_keeps_finished : forall tb env s u p, step tb env s u -> finished s p -> finished u p.
Proof.
  intros tb env s u [kp n] St (Hs & Hn). split; [eapply step_started; eauto; exact Hs|]. unfold started in Hs.
  cbn [fst snd] in *. intros Hin. apply Hn. inversion St; subst; cbn [stack] in Hin.
  - destruct (Nat.eq_dec kp k) as [->|Ne]; [rewrite set_same in Hin|rewrite set_other in Hin by exact Ne; exact Hin].
    destruct Hin as [E|Hin]; [simpl in E; lia|exact Hin].
  - exact Hin.
  - destruct (Nat.eq_dec kp k) as [->|Ne]; [rewrite set_same in Hin|rewrite set_other in Hin by exact Ne; exact Hin].
    rewrite H0. rewrite map_app in *. simpl. apply in_app_or in Hin. apply in_or_app. simpl. tauto.
  - destruct (Nat.eq_dec kp k) as [->|Ne]; [rewrite set_same in Hin|rewrite set_other in Hin by exact Ne; exact Hin].
    rewrite H0. rewrite map_app in *. exact Hin.
  - destruct (stack s kp) as [|[x l] st]; exact Hin.
  - destruct (H kp) as [E|[_ E]]; rewrite E in Hin; [exact Hin|]. destruct (stack s kp) as [|[x l] st]; exact Hin.
Qed.

(** When time goes on, stacks stay. *)
Lemma step_in_time : forall tb env s u, step tb env s u -> now s < now u ->
  now u = now s + 1 /\ forall k, map fst (stack u k) = map fst (stack s k).
Proof.
  intros tb env s u St Lt. inversion St; subst; cbn [now stack] in *; try lia; split; auto; intros k.
  - destruct (stack s k) as [|[x l] st]; reflexivity.
  - destruct (H k) as [->|[_ ->]]; [reflexivity|]. destruct (stack s k) as [|[x l] st]; reflexivity.
Qed.

Section Losing.
Variables (N : Z) (w : witness) (gap loss : Z).
Hypothesis positive : 0 < N.
Hypothesis accepted : check_losing w gap loss = true.
Variable origin : nat -> Z.
Hypothesis first_origin : 0 <= origin O.
Hypothesis apart : forall n, origin n + N * gap <= origin (S n).
Variables (env : environment) (late : Z) (before : Z -> Z).

Let rules := laps_at N w origin origin.
Let F := N * w_lap w.
Let W := F + N * loss + late.

Hypothesis late_nonneg : 0 <= late.
Hypothesis environment_is_punctual : punctual rules env late.
Hypothesis before_grows : forall x y, x <= y -> before x <= before y.
Hypothesis windows : forall x, before (x + W + 1) <= before x + N * loss.

Let lap (p : place) := (snd p / length (list_of w (fst p)))%nat.

Lemma checks : check_sporadic w = true /\ 0 < w_lap w /\ 0 <= loss /\ w_lap w + loss <= gap /\
  forall p, (fst p < length (w_lists w))%nat -> 0 <= e_start (entry_at w p) /\ e_finish (entry_at w p) <= w_lap w.
Proof.
  pose proof accepted as A. unfold check_losing in A. rewrite !andb_true_iff, !Z.leb_le, forallb_forall in A.
  destruct A as (((A & Fin) & L) & G). split; [exact A|].
  destruct (parts w (checked w A)) as (H & _). split; [exact H|]. split; [exact L|]. split; [exact G|].
  intros p Hp. split; [apply start_nonneg; auto|]. specialize (Fin (list_of w (fst p)) ltac:(apply nth_In; exact Hp)).
  rewrite forallb_forall in Fin. apply Z.leb_le, Fin, in_list; auto.
Qed.

Lemma lengths : 0 < F /\ 0 <= N * loss /\ F + N * loss <= N * gap.
Proof. destruct checks as (_ & ? & ? & ? & _). unfold F. repeat split; nia. Qed.

Lemma origin_grows : forall n m, (n <= m)%nat -> origin n <= origin m.
Proof. intros n m H. pose proof lengths. induction H as [|m H' IH]; [lia|]. pose proof (apart m). lia. Qed.

Lemma begun_before : forall n m t, origin n <= t -> t < origin m -> (n < m)%nat.
Proof.
  intros n m t Hn Hm. destruct (Nat.lt_ge_cases n m) as [|H]; auto. pose proof (origin_grows m n H). lia.
Qed.

(** Of [c] laps that have begun, each is moved by what was lost before its release. *)
Definition lost_by (c : nat) : Z := match c with O => 0 | S c => before (origin c) end.
Definition moved (c m : nat) : Z := origin m - lost_by (Nat.min (S m) c).
Let tb (c : nat) : table := laps_at N w (moved c) origin.

(** A lap of those, and what was lost in it, are over as the next one begins. *)
Definition over (c : nat) : Prop := forall m, (S m < c)%nat ->
  before (origin (S m)) - before (origin m) <= origin (S m) - origin m - F.

Lemma moved_apart : forall c, over c -> forall m, moved c m + F <= moved c (S m).
Proof.
  intros c Ov m. unfold moved. destruct (Nat.lt_ge_cases (S m) c) as [H|H].
  - rewrite !Nat.min_l by lia. specialize (Ov m H). simpl. lia.
  - rewrite !Nat.min_r by lia. pose proof (apart m). pose proof lengths. lia.
Qed.

Lemma moved_grows : forall c, over c -> forall m m', (m < m')%nat -> moved c m + F <= moved c m'.
Proof.
  intros c Ov m m' H. pose proof lengths. induction H as [|m' H IH]; [apply moved_apart, Ov|].
  pose proof (moved_apart c Ov m'). lia.
Qed.

Lemma moved_fits : forall c, over c -> fits (tb c).
Proof. intros c Ov. apply laps_fit; [exact positive|apply checks|apply moved_apart, Ov]. Qed.

Lemma step_of_moved : forall c s u, step rules env s u -> step (tb c) env s u.
Proof.
  intros c s u St. unfold rules, tb in *. destruct St as [s k H R|s k H R V|s k above x l below H E|s k above x l below H E|s Q|s st H].
  - exact (Start (tb c) env s k H R).
  - exact (Pass (tb c) env s k H R V).
  - exact (End (tb c) env s k above x l below H E).
  - exact (Exceed (tb c) env s k above x l below H E).
  - exact (Tick (tb c) env s Q).
  - exact (Stall (tb c) env s st H).
Qed.

Lemma moved_same : forall c m, (m < c)%nat -> moved (S c) m = moved c m.
Proof. intros c m H. unfold moved. rewrite !Nat.min_l by lia. reflexivity. Qed.

(** *** What holds in each state *)

Definition all_but_now (c : nat) (s : state) : Prop :=
  over c /\ (forall m, (m < c)%nat -> origin m <= now s) /\ lost_by c <= lost s /\
  on_time (tb c) (late + lost s) s /\
  (forall k x, In x (map fst (stack s k)) -> origin (lap (k, x)) <= now s) /\ (forall p, ended s p <= now s) /\
  (* behind the window of the last lap only time is lost *)
  (forall m, c = S m -> origin m + W < now s ->
    lost s <= before (origin m) + N * loss + (now s - (origin m + W + 1))).

Definition holds (c : nat) (s : state) : Prop := all_but_now c s /\ now s < origin c.

Lemma lost_by_grows : forall c s m, all_but_now c s -> lost_by (Nat.min (S m) c) <= lost s.
Proof.
  intros c s m (_ & _ & Lb & _). destruct (Nat.min_spec (S m) c) as [(H & ->)|(_ & ->)]; [|exact Lb].
  destruct c as [|c]; [lia|]. simpl in *. pose proof (before_grows _ _ (origin_grows m c ltac:(lia))). lia.
Qed.

(** *** The next lap begins *)

Lemma start_of_lap : forall c p, (fst p < length (w_lists w))%nat -> moved c (lap p) <= start (tb c) p.
Proof. intros c p Hp. destruct checks as (_ & _ & _ & _ & E). destruct (E p Hp). simpl. fold (lap p). nia. Qed.

Lemma finish_of_lap : forall c p, (fst p < length (w_lists w))%nat -> finish (tb c) p <= moved c (lap p) + F.
Proof. intros c p Hp. destruct checks as (_ & _ & _ & _ & E). destruct (E p Hp). unfold F. simpl. fold (lap p). nia. Qed.

Lemma good_moved : forall c k i st b, (k < length (w_lists w))%nat -> over (S c) ->
  (forall x, In x (map fst st) -> (lap (k, x) < c)%nat) -> good (tb c) k i b st -> good (tb (S c)) k i b st.
Proof.
  intros c k i st b Hk Ov. revert b. induction st as [|[x l] st IH]; intros b Early G; [exact I|].
  destruct G as (Hl & Hx & (n & (Hd & Hfin) & Hsum) & Hf & Hg).
  assert (Lx : (lap (k, x) < c)%nat) by (apply Early; left; reflexivity).
  assert (Same : forall q, (lap q < c)%nat -> finish (tb (S c)) q = finish (tb c) q /\ start (tb (S c)) q = start (tb c) q).
  { intros q Hq. unfold tb; simpl. fold (lap q). rewrite (moved_same c (lap q) Hq). auto. }
  split; [exact Hl|]. split; [exact Hx|]. split; [|split; [exact Hf|apply IH; [|exact Hg]; intros y Hy; apply Early; right; exact Hy]].
  exists n. split; [split; [exact Hd|]|].
  - destruct (Nat.lt_ge_cases (lap (k, (i + n)%nat)) c) as [H|H].
    + rewrite (proj1 (Same _ Lx)), (proj2 (Same _ H)). exact Hfin.
    + pose proof (finish_of_lap (S c) (k, x) Hk). pose proof (start_of_lap (S c) (k, (i + n)%nat) Hk).
      pose proof (moved_grows (S c) Ov (lap (k, x)) (lap (k, (i + n)%nat)) ltac:(lia)). lia.
  - rewrite (proj1 (Same _ Lx)). exact Hsum.
Qed.

(** A lap that has not begun, at the release of lap [c], starts no earlier. *)
Lemma starts_later : forall c s p, (fst p < length (w_lists w))%nat -> now s = origin c -> before (now s) <= lost s ->
  (c <= lap p)%nat -> now s <= start (tb (S c)) p + (late + lost s).
Proof.
  intros c s p Hp Hn Hb Hc. pose proof (start_of_lap (S c) p Hp) as St. unfold moved in St.
  rewrite Nat.min_r in St by lia. cbn [lost_by] in St. rewrite <- Hn in St. pose proof (origin_grows c (lap p) Hc). lia.
Qed.

Lemma on_time_moved : forall c s, over (S c) -> now s = origin c -> before (now s) <= lost s ->
  (forall k x, In x (map fst (stack s k)) -> (lap (k, x) < c)%nat) -> (forall p, ended s p <= now s) ->
  on_time (tb c) (late + lost s) s -> on_time (tb (S c)) (late + lost s) s.
Proof.
  intros c s Ov Hn Hb Early En (Hot & Hw).
  assert (Same : forall q, (lap q < c)%nat -> start (tb (S c)) q = start (tb c) q).
  { intros q Hq. unfold tb; simpl. fold (lap q). rewrite (moved_same c (lap q) Hq). auto. }
  split.
  - intros k Hk. destruct (Hot k Hk) as (Hs & Hg). split; [|apply good_moved; auto].
    destruct (Nat.lt_ge_cases (lap (next s k)) c) as [H|H]; [rewrite (Same _ H); exact Hs|].
    pose proof (starts_later c s (next s k) Hk Hn Hb H). lia.
  - intros p y Hy B Fi Ns. destruct (Nat.lt_ge_cases (lap y) c) as [H|H]; [rewrite (Same _ H); apply Hw; auto|].
    pose proof (starts_later c s y Hy Hn Hb H) as L. pose proof (En p) as E.
    destruct (precedence _ (moved_fits (S c) Ov) p y Hy B) as (Hp & _ & Hf & _).
    destruct checks as (Cs & _). pose proof B as (_ & _ & J).
    assert (Jp : job_at w p = Z.of_nat (lap p)) by (apply job_is_lap; auto).
    assert (Jy : job_at w y = Z.of_nat (lap y)) by (apply job_is_lap; auto).
    destruct J as [(J & _)|(J & _)].
    + pose proof (starts_later c s p Hp Hn Hb ltac:(lia)). pose proof (start_finish (tb (S c)) (moved_fits (S c) Ov) p Hp). lia.
    + assert (Z0 : wait (tb (S c)) p y = 0).
      { simpl. unfold wait_of. destruct (Z.eqb_spec (job_at w p) (job_at w y)); lia. }
      change (wait (tb (S c)) p y) with (wait (tb c) p y) in Z0. change (wait (tb (S c)) p y) with (wait (tb c) p y). lia.
Qed.

(** Either the next lap is still to come, or it begins now. *)
Lemma settles : forall c s, all_but_now c s -> now s <= origin c ->
  (now s = origin c -> before (now s) <= lost s /\ forall k x, In x (map fst (stack s k)) -> origin (lap (k, x)) < now s) ->
  exists c, holds c s.
Proof.
  intros c s A Hn Hc. pose proof lengths as (HF & HL & HG). destruct (Z_lt_ge_dec (now s) (origin c)) as [L|L]; [exists c; split; auto|].
  assert (E : now s = origin c) by lia. destruct (Hc E) as (Hb & Early). destruct A as (Ov & Beg & Lb & Hot & Rel & En & K).
  assert (Ov' : over (S c)).
  { intros m Hm. destruct (Nat.lt_ge_cases (S m) c) as [H|H]; [apply Ov, H|]. assert (c = S m) as -> by lia.
    rewrite <- E. pose proof (apart m). destruct (Z_lt_ge_dec (origin m + W) (now s)) as [Hw|Hw].
    - specialize (K m eq_refl Hw). unfold W in K. lia.
    - pose proof (windows (origin m)). pose proof (before_grows (now s) (origin m + W + 1) ltac:(lia)). lia. }
  exists (S c). split; [|pose proof (apart c); lia]. split; [exact Ov'|]. split.
  { intros m Hm. pose proof (origin_grows m c ltac:(lia)). lia. }
  split; [simpl; rewrite <- E; exact Hb|]. split; [|split; [exact Rel|split; [exact En|]]].
  - apply on_time_moved; auto. intros k x Hx. apply (begun_before _ _ (origin (lap (k, x)))); [lia|]. rewrite <- E. apply Early, Hx.
  - intros m Hm Hw. injection Hm as <-. unfold W in Hw. lia.
Qed.

(** *** A step *)

Lemma released_in_time : forall c s, holds c s -> released_by (tb c) env (late + lost s) s.
Proof.
  intros c s (A & _) k Hk Hs. change (k < length (w_lists w))%nat in Hk. pose proof (start_of_lap c (next s k) Hk) as St.
  pose proof (lost_by_grows c s (lap (next s k)) A) as Lb. unfold moved in St.
  assert (R : release rules (next s k) + late <= now s) by (change (origin (lap (next s k)) + late <= now s); lia).
  destruct (environment_is_punctual (next s k) (now s) Hk R) as [H|H]; [left; exact H|right]. split; [|exact H].
  change (release rules (next s k) <= now s). lia.
Qed.

Lemma next_state : forall c s u, holds c s -> step rules env s u ->
  (forall k x, In x (map fst (stack u k)) -> release rules (k, x) <= now u) ->
  before (now u) <= lost u <= before (now s + 1) -> exists c, holds c u.
Proof.
  intros c s u H St Rel Led. pose proof (step_of_moved c s u St) as St'. pose proof H as ((Ov & Beg & Lb & Hot & Rs & En & K) & Hc).
  destruct (step_on_time (tb c) (moved_fits c Ov) env s u (late + lost s) (released_in_time c s H) Hot St') as (Hot' & Ln).
  replace (late + lost s + (lost u - lost s)) with (late + lost u) in Hot' by lia.
  assert (T : now u = now s \/ now u = now s + 1) by (inversion St; subst; simpl; auto).
  apply (settles c u).
  - split; [exact Ov|]. split; [intros m Hm; specialize (Beg m Hm); lia|]. split; [lia|]. split; [exact Hot'|].
    split; [exact Rel|]. split.
    + intros p. pose proof (En p). inversion St; subst; simpl in *; try lia; unfold set_place;
        match goal with |- context [if ?c then _ else _] => destruct c end; lia.
    + intros m Hm Hw. pose proof (windows (origin m)) as Wi. destruct (Z_lt_ge_dec (origin m + W) (now s)) as [Hs|Hs].
      * specialize (K m Hm Hs). inversion St; subst; cbn [now lost] in *; try lia. exfalso.
        rename H1 into E. destruct (proj1 Hot k H0) as (_ & G).
        assert (In x (map fst (stack s k))) as Hx by (rewrite E, map_app; apply in_or_app; right; left; reflexivity).
        destruct (good_in (tb (S m)) (moved_fits (S m) Ov) _ _ _ _ _ H0 G Hx) as (_ & Le & _).
        pose proof (finish_of_lap (S m) (k, x) H0) as Fi.
        assert (Lx : (lap (k, x) < S m)%nat) by (apply (begun_before _ _ (now s)); [apply Rs, Hx|exact Hc]).
        assert (moved (S m) (lap (k, x)) <= moved (S m) m).
        { destruct (Nat.eq_dec (lap (k, x)) m) as [->|Ne]; [lia|]. pose proof lengths.
          pose proof (moved_grows (S m) Ov (lap (k, x)) m ltac:(lia)). lia. }
        unfold moved at 2 in H1. rewrite Nat.min_id in H1. simpl in H1. unfold W in K. lia.
      * assert (now u = now s + 1) by lia. assert (now s + 1 = origin m + W + 1) as E by lia. rewrite E in Led. lia.
  - lia.
  - intros E. split; [apply Led|]. intros k x Hx. destruct (step_in_time _ _ _ _ St ltac:(lia)) as (_ & Sk).
    rewrite Sk in Hx. specialize (Rs k x Hx). lia.
Qed.

Lemma always : forall s, losing_run rules env before s -> exists c, holds c s.
Proof.
  intros s R. induction R as [Z0|s u R (c & IH) St Rel Led]; [|apply (next_state c s u); auto].
  apply (settles O).
  - split; [intros m Hm; lia|]. split; [intros m Hm; lia|]. split; [reflexivity|]. split; [|split; [intros k x []|split; [reflexivity|discriminate]]].
    split; [|intros p y _ _ (Hs & _); unfold started in Hs; simpl in Hs; lia].
    intros k Hk. split; [|exact I]. pose proof (start_of_lap O (next initial k) Hk) as St. unfold moved in St. cbn [Nat.min lost_by] in St.
    pose proof (origin_grows O (lap (next initial k)) ltac:(lia)). simpl in *. lia.
  - simpl. exact first_origin.
  - intros _. split; [simpl; lia|intros k x []].
Qed.

(** One place: if each window that is as long as its bound loses [own] at most. *)
Lemma finished_in_time : forall p bound own s, losing_run rules env before s -> (fst p < length (w_lists w))%nat ->
  0 <= own -> N * e_finish (entry_at w p) + own + late <= bound -> (forall x, before (x + bound + 1) <= before x + own) ->
  ~ finished s p -> now s <= origin (lap p) + bound.
Proof.
  intros p bound own s R Hp Ho Hb Wi. pose proof checks as (_ & _ & _ & _ & E). destruct (E p Hp) as (E1 & _).
  assert (Pos : 0 <= N * e_finish (entry_at w p)).
  { pose proof (start_finish (tb 0) (moved_fits 0 ltac:(intros m Hm; lia)) p Hp) as Sf. simpl in Sf. nia. }
  induction R as [Z0|s u R IH St Rel Led]; intros Nf.
  - pose proof (origin_grows O (lap p) ltac:(lia)). simpl. lia.
  - assert (L : now s <= origin (lap p) + bound) by (apply IH; intros Fi; apply Nf; eapply step_keeps_finished; eauto).
    destruct (Z_lt_ge_dec (origin (lap p) + bound) (now u)) as [Lt|]; [exfalso|lia].
    destruct (step_in_time _ _ _ _ St ltac:(lia)) as (Tu & _).
    destruct (always u ltac:(eapply Goes_on; eauto)) as (c & (Ov & _ & _ & Hot & _) & Hc).
    destruct (on_time_bounds (tb c) (moved_fits c Ov) _ _ p Hot Hp) as (_ & Fin). specialize (Fin Nf).
    change (finish (tb c) p) with (N * e_finish (entry_at w p) + moved c (lap p)) in Fin.
    assert (Lc : (lap p < c)%nat) by (apply (begun_before _ _ (now u)); [|exact Hc]; lia).
    unfold moved in Fin. rewrite Nat.min_l in Fin by lia. cbn [lost_by] in Fin. specialize (Wi (origin (lap p))).
    replace (now s + 1) with (origin (lap p) + bound + 1) in Led by lia. lia.
Qed.

(** **Losses in windows.** If [check_losing] accepts, then in every such run of which no window as long as a lap's bound, late
    releases and one tick more loses above [loss], each subtask is finished within its bound, which contains what a window
    as long as that may lose. *)
Theorem losing_bounds_hold : forall s, losing_run rules env before s ->
  forall d n v own, (d < length (w_dags w))%nat -> let g := nth d (w_dags w) no_dag in
  (v < length (d_subtasks g))%nat -> 0 <= own ->
  let bound := N * (s_bound (nth v (d_subtasks g) no_subtask) + own) + late in
  (forall x, before (x + bound + 1) <= before x + N * own) ->
  exists p, (fst p < cores rules)%nat /\ instance_at w p = (d, Z.of_nat n, v) /\ lap p = n /\
    (~ finished s p -> now s <= origin n + bound).
Proof.
  intros s R d n v own Hd g Hv Ho bound Wi. destruct checks as (Cs & _).
  destruct (finish_in_lap w Cs d n v Hd Hv) as (p & Hp & Hi & Hlap & Hf). fold g in Hf. exists p.
  split; [exact Hp|]. split; [exact Hi|]. split; [exact Hlap|]. intros Nf.
  change (lap p = n) in Hlap. rewrite <- Hlap. apply (finished_in_time p bound (N * own) s R Hp); auto; [nia|]. unfold bound. nia.
Qed.

End Losing.

(** ** A loss in each lap: laps of 2 that are 3 apart, and one of which is not finished before its bound of 3 *)

Definition lone : witness := Witness 2 [Dag 2 0 [Subtask 2 2 false []]] [[Entry 0 0 0 0 2 0]].

Example a_loss_is_attained :
  let origin n := 3 * Z.of_nat n in
  let tb := laps_at 1 lone origin origin in
  let env := {| released := fun p t => release tb p <=? t; void := fun _ _ => false |} in
  let before t := if t <=? 0 then 0 else 1 in
  check_losing lone 3 1 = true /\ check_losing lone 2 1 = false /\
  (forall x, before (x + 3 + 1) <= before x + 1) /\
  exists s, losing_run tb env before s /\ now s = 3 /\ ~ finished s (O, O).
Proof.
  intros origin tb env before. split; [reflexivity|]. split; [reflexivity|]. split.
  { intros x. unfold before. destruct (x + 3 + 1 <=? 0), (x <=? 0); lia. }
  set (f0 := set (fun _ => []) O [(O, 2)]). set (f1 := fun k => spend (f0 k)). set (f2 := fun k => spend (f1 k)).
  set (at_ t l f := {| now := t; lost := l; position := set (fun _ => O) O 1%nat; stack := f; ended := fun _ => 0 |}).
  assert (Go : forall s t l f, losing_run tb env before s -> step tb env s (at_ t l f) ->
    map (fun k => map fst (f k)) [O] = [[O]] -> (forall k, f (S k) = []) -> 0 <= t ->
    before t <= l <= before (now s + 1) -> losing_run tb env before (at_ t l f)).
  { intros s t l f R St S0 Sk Ht L. apply Goes_on with s; auto. intros [|k] x; simpl.
    - injection S0 as ->. intros [<-|[]]. exact Ht.
    - rewrite Sk. intros []. }
  assert (R0 : losing_run tb env before (at_ 0 0 f0)).
  { apply Go with initial; [constructor; reflexivity| |auto..|cbv; split; discriminate]; [|lia].
    apply (Start tb env initial O); [simpl; lia|exact I]. }
  assert (R1 : losing_run tb env before (at_ 1 1 f0)).
  { apply Go with (at_ 0 0 f0); [exact R0| |auto..|cbv; split; discriminate]; [|lia].
    apply (Stall tb env (at_ 0 0 f0)). auto. }
  assert (Q : forall t f, t < 3 -> snd (hd (O, 0) (f O)) > 0 -> quiet tb env (at_ t 1 f)).
  { intros t f Ht Hf [|k] Hk; [|simpl in Hk; lia]. split.
    - intros (_ & [(_ & H)|(H & _)]); [discriminate|]. apply Z.leb_le in H. cbn in H. lia.
    - simpl in *. destruct (f O) as [|[x l] st]; [exact I|simpl in Hf; lia]. }
  assert (R2 : losing_run tb env before (at_ 2 1 f1)).
  { apply Go with (at_ 1 1 f0); [exact R1| |auto..|cbv; split; discriminate]; [|lia].
    apply (Tick tb env (at_ 1 1 f0)), Q; [lia|reflexivity]. }
  exists (at_ 3 1 f2). split; [|split; [reflexivity|intros (_ & H); apply H; left; reflexivity]].
  apply Go with (at_ 2 1 f1); [exact R2| |auto..|cbv; split; discriminate]; [|lia].
  apply (Tick tb env (at_ 2 1 f1)), Q; [lia|reflexivity].
Qed.

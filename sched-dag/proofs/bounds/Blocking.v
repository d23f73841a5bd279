(** * Subtasks that keep their cores: blocking by lower-ranked work

    docs/bounds.md, "Subtasks that are never preempted", for one job among others.  All its vertices [on] a core keep it until they end, and
    the others, its waits, need nobody.  In each tick others are higher-ranked work, [high t] cores, and lower-ranked
    subtasks [0 .. L - 1], of which [low_holds t l] says whether l has a core; a run of it takes [longest l] at most.
    In the ticks [skip] what has a core may be interrupted; then what executes is [high].

    Two things are used: a lower-ranked subtask starts in no tick in which a ready vertex of the job waits to begin;
    and those that hold cores when a stretch of such ticks begins, after the release, leave one to a predecessor. *)

Require Import Arith Lia Bool List.
From Bounds Require Import Sums Model Chains OneTick Account ResponseTime AlongAPath.

(** The sum of the q largest of [longest 0 .. longest (L - 1)], or more: it is the least of these over all
    [level], and attained where [level] is the q-th largest. *)
Definition largest (q level L : nat) (longest : nat -> nat) : nat :=
  q * level + sum L (fun l => longest l - level).

Definition has_predecessor (G : dag) (v : nat) : bool :=
  existsb (fun u => edge G u v) (seq 0 (size G)).

(** Some ready vertex waits for its core.  (One that has begun has its own, but may be interrupted on it.) *)
Definition waits_to_begin (G : dag) (s : run) (t : nat) : bool :=
  existsb (fun v => ready_bool G s t v && (done s t v =? 0) && negb (runs s t v)) (seq 0 (size G)).

Lemma waits_to_begin_true G s t :
  waits_to_begin G s t = true <-> exists v, ready G s t v /\ done s t v = 0 /\ runs s t v = false.
Proof.
  unfold waits_to_begin. rewrite existsb_exists. split.
  - intros (v & _ & H). rewrite !andb_true_iff, ready_bool_true, negb_true_iff, Nat.eqb_eq in H.
    exists v. tauto.
  - intros (v & Rd & D & E). exists v. rewrite in_seq, !andb_true_iff, ready_bool_true, negb_true_iff, Nat.eqb_eq.
    pose proof Rd as (Hv & _). split; [lia|auto].
Qed.

Section blocking.
Variables (G : dag) (m : nat) (s : run).
Variables (on : nat -> bool) (L : nat) (low_holds : nat -> nat -> bool) (longest : nat -> nat).
Variables (high : nat -> nat) (skip : nat -> bool).

Definition low (t : nat) : nat := count L (low_holds t).

(** The cores that execute the job. *)
Definition own_cores (t : nat) : nat := count (size G) (fun v => on v && runs s t v).

Record keeps_cores : Prop := {
  obeys : legal G m s;
  m_cores : forall t, own_cores t + low t <= m;
  others_are : forall t, others s t <= high t + (if skip t then 0 else low t);
  (** The job's own vertices keep their cores. *)
  own_keep : forall t v, v < size G -> on v = true -> skip t = false -> 0 < done s t v -> ~ finished s t v -> runs s t v = true;
  takes_time : forall v, v < size G -> on v = true -> 0 < exec s v;
  waits_run : forall t v, on v = false -> ready G s t v -> runs s t v = true;
  (** Nothing of lower rank starts while a vertex waits. *)
  no_start : forall t l, l < L ->
    waits_to_begin G s (S t) = true -> low_holds (S t) l = true -> low_holds t l = true;
  (** So if l holds its core in n ticks on end in each of which a vertex waits, that is one run of it. *)
  runs_end : forall b n l, l < L ->
    (forall i, i < n -> waits_to_begin G s (b + i) = true /\ low_holds (b + i) l = true) ->
    count n (fun i => negb (skip (b + i))) <= longest l
}.

Hypothesis rules : keeps_cores.
Notation waits t := (waits_to_begin G s t).

Lemma waits_or_skip t : somebody_waits G s t = true -> skip t = false -> waits t = true.
Proof.
  intros W Sk. apply somebody_waits_true in W. destruct W as (v & Rd & E). apply waits_to_begin_true.
  exists v. split; [auto|]. split; [|auto]. destruct (Nat.eq_dec (done s t v) 0); auto.
  destruct (on v) eqn:O; [|rewrite (waits_run rules t v O Rd) in E; discriminate].
  destruct Rd as (Hv & N & _). rewrite (own_keep rules t v Hv O Sk ltac:(lia) N) in E. discriminate.
Qed.

(** For how many ticks on end, up to t, some vertex has waited, and how many of these count. *)
Fixpoint waited (t : nat) : nat :=
  match t with
  | 0 => 0
  | S p => if waits p then S (waited p) else 0
  end.

Fixpoint age (t : nat) : nat :=
  match t with
  | 0 => 0
  | S p => if waits p then age p + Nat.b2n (negb (skip p)) else 0
  end.

Lemma stretch t l : l < L -> waits t = true -> low_holds t l = true ->
  exists b, t = b + waited t /\ age t = count (waited t) (fun i => negb (skip (b + i))) /\
    forall i, i < S (waited t) -> waits (b + i) = true /\ low_holds (b + i) l = true.
Proof.
  intros Hl. induction t; intros W R.
  - exists 0. split; [reflexivity|]. split; [reflexivity|].
    intros i Hi. simpl in Hi. replace i with 0 by lia. auto.
  - simpl waited. simpl age. destruct (waits t) eqn:Wt.
    + destruct (IHt eq_refl) as (b & E & A & H); [apply (no_start rules); auto|].
      exists b. split; [lia|]. split.
      * rewrite A. unfold count. cbn [sum]. rewrite <- E. reflexivity.
      * intros i Hi. destruct (Nat.eq_dec i (S (waited t))) as [->|Ne]; [|apply H; lia].
        replace (b + S (waited t)) with (S t) by lia. auto.
    + exists (S t). split; [lia|]. split; [reflexivity|].
      intros i Hi. replace (S t + i) with (S t) by lia. auto.
Qed.

Lemma long_enough t l : l < L -> waits t = true -> low_holds t l = true ->
  age t + Nat.b2n (negb (skip t)) <= longest l.
Proof.
  intros Hl W R. destruct (stretch t l Hl W R) as (b & E & A & H).
  pose proof (runs_end rules b _ l Hl H) as B. unfold count in *. cbn [sum] in B. rewrite <- E in B. lia.
Qed.

(** ** A stretch after the release begins as a vertex becomes ready *)

Definition becomes_ready (t v : nat) : bool :=
  match t with
  | 0 => false
  | S p => ready_bool G s (S p) v && negb (ready_bool G s p v)
  end.

Lemma begin_of_stretch p : waits p = false -> waits (S p) = true ->
  exists v, v < size G /\ becomes_ready (S p) v = true /\ has_predecessor G v = true /\ 0 < busy G s p.
Proof.
  intros Wp W. apply waits_to_begin_true in W. destruct W as (v & Rd & D & E).
  pose proof Rd as (Hv & _ & _).
  assert (NR : ~ ready G s p v).
  { intros Rp. rewrite done_next in D. assert (waits p = true); [|congruence].
    apply waits_to_begin_true. exists v. destruct (runs s p v); simpl in D; [lia|]. split; [auto|]. split; [lia|auto]. }
  destruct (becomes_ready_after G s p v Rd NR) as (u & Hu & Eu & _ & Ru).
  exists v. split; [auto|]. split; [|split].
  - simpl. apply andb_true_iff. split; [apply ready_bool_true; auto|].
    apply negb_true_iff. destruct (ready_bool G s p v) eqn:B; auto.
    apply ready_bool_true in B. tauto.
  - destruct (last_edge G u v Eu) as (w & Ew). pose proof (edges_lead_up _ _ _ Ew).
    unfold has_predecessor. apply existsb_exists. exists w. rewrite in_seq. split; [lia|auto].
  - pose proof (sum_term (size G) (fun v => Nat.b2n (runs s p v)) u Hu) as T. cbv beta in T.
    rewrite Ru in T. simpl in T. unfold busy, count. lia.
Qed.

(** Until here the job may wait for devices.  Without, each predecessor leaves a core. *)
Definition all_on : Prop := forall v, v < size G -> on v = true.

Lemma busy_is_own t : all_on -> busy G s t = own_cores t.
Proof. intros A. apply sum_ext. intros v Hv. rewrite (A v Hv). reflexivity. Qed.

Lemma fewer_low t : all_on -> waits t = true -> waited t < t -> low t <= m - 1.
Proof.
  intros A. induction t; intros W H; [simpl in H; lia|].
  assert (Less : low (S t) <= low t).
  { apply sum_le. intros l Hl. destruct (low_holds (S t) l) eqn:E; simpl; [|lia].
    rewrite (no_start rules t l Hl W E). simpl. lia. }
  simpl in H. destruct (waits t) eqn:Wt.
  - specialize (IHt eq_refl ltac:(lia)). lia.
  - destruct (begin_of_stretch t Wt W) as (_ & _ & _ & _ & B).
    rewrite (busy_is_own t A) in B. pose proof (m_cores rules t). lia.
Qed.

(** How many stretches begin after the release. *)
Definition begins (t : nat) : bool := (0 <? t) && waits t && (waited t =? 0).

Lemma few_stretches r : count r begins <= count (size G) (has_predecessor G).
Proof.
  apply Nat.le_trans
    with (sum r (fun t => sum (size G) (fun v => Nat.b2n (has_predecessor G v && becomes_ready t v)))).
  - apply sum_le. intros t _. unfold begins. destruct t as [|p]; [simpl; lia|].
    simpl waited. destruct (waits (S p)) eqn:W; [|simpl; lia].
    destruct (waits p) eqn:Wp; [simpl; lia|]. simpl.
    destruct (begin_of_stretch p Wp W) as (v & Hv & Bv & Pv & _).
    pose proof (sum_term (size G) (fun v => Nat.b2n (has_predecessor G v && becomes_ready (S p) v)) v Hv)
      as T.
    cbv beta in T. rewrite Bv, Pv in T. simpl in *. lia.
  - rewrite sum_swap. apply sum_le. intros v Hv.
    destruct (has_predecessor G v); simpl; [|rewrite sum_zero; auto].
    apply (count_at_most_one r (fun t => becomes_ready t v)).
    assert (Once : forall a b, becomes_ready a v = true -> becomes_ready b v = true -> ~ a < b).
    { intros a b Ha Hb Hab. destruct a as [|a]; [discriminate|]. destruct b as [|b]; [discriminate|].
      simpl in Ha, Hb. apply andb_true_iff in Ha, Hb. destruct Ha as (Ha & _), Hb as (Hb & Nb).
      apply ready_bool_true in Ha, Hb. destruct Ha as (_ & _ & Pa), Hb as (_ & Fb & _).
      apply negb_true_iff in Nb.
      assert (ready_bool G s b v = true); [|congruence].
      apply ready_bool_true. split; [auto|]. split.
      - intros F. apply Fb, finished_later with b; auto.
      - intros u Eu. apply finished_later with (S a); [lia|auto]. }
    intros a b _ _ Ha Hb. destruct (lt_eq_lt_dec a b) as [[H|H]|H]; auto; exfalso.
    + apply (Once a b); auto.
    + apply (Once b a); auto.
Qed.

(** ** What lower-ranked work executes while a vertex waits *)

Lemma one_tick_of_blocking q level o k (before now : nat -> bool) :
  k <= q -> k <= count L now ->
  (forall l, l < L -> now l = true -> before l = true /\ S o <= longest l) ->
  k + q * (level - S o) + sum L (fun l => if now l then longest l - Nat.max level (S o) else 0)
  <= q * (level - o) + sum L (fun l => if before l then longest l - Nat.max level o else 0).
Proof.
  intros Kq Kn H. destruct (le_lt_dec level o) as [Lo|Lo].
  - replace (level - S o) with 0 by lia. rewrite Nat.mul_0_r, Nat.add_0_r.
    apply Nat.le_trans
      with (count L now + sum L (fun l => if now l then longest l - Nat.max level (S o) else 0)); [lia|].
    unfold count. rewrite <- sum_plus.
    apply Nat.le_trans with (sum L (fun l => if before l then longest l - Nat.max level o else 0)); [|lia].
    apply sum_le. intros l Hl. specialize (H l Hl). destruct (now l); simpl; [|lia].
    destruct (H eq_refl) as (-> & Hl'). lia.
  - replace (level - o) with (S (level - S o)) by lia. rewrite Nat.mul_succ_r.
    assert (sum L (fun l => if now l then longest l - Nat.max level (S o) else 0)
            <= sum L (fun l => if before l then longest l - Nat.max level o else 0)).
    { apply sum_le. intros l Hl. specialize (H l Hl). destruct (now l); [|lia].
      destruct (H eq_refl) as (-> & _). lia. }
    lia.
Qed.

(** ** Blocking along a path

    While a vertex of a path waits (AlongAPath.v), lower-ranked work starts nowhere, so it blocks once for each
    vertex: by the m - 1 largest of it, as a predecessor has left a core; by the m largest after a wait. *)

Section path.
Variables (level0 level1 : nat).

Lemma ran_before a n l : l < L ->
  (forall i, i < S n -> waits (a + i) = true) -> low_holds (a + n) l = true ->
  forall i, i < S n -> low_holds (a + i) l = true.
Proof.
  intros Hl. induction n; intros W E i Hi.
  - replace i with 0 by lia. auto.
  - destruct (Nat.eq_dec i (S n)) as [->|Ne]; [auto|]. apply IHn; [intros; apply W; lia| |lia].
    apply (no_start rules _ l Hl).
    + replace (S (a + n)) with (a + S n) by lia. apply W. lia.
    + replace (S (a + n)) with (a + S n) by lia. auto.
Qed.

Definition counted (t : nat) : nat := if skip t then 0 else Nat.min (low t) m.

Lemma one_stretch few level' a n :
  (forall i, i < n -> waits (a + i) = true) -> (0 < n -> low a <= few) ->
  sum n (fun i => counted (a + i)) <= largest few level' L longest.
Proof.
  destruct n as [|n]; intros W Q; [simpl; lia|]. specialize (Q ltac:(lia)).
  set (so_far k := count k (fun i => negb (skip (a + i)))).
  assert (Next : forall k, so_far (S k) = so_far k + Nat.b2n (negb (skip (a + k)))) by reflexivity.
  assert (Long : forall k l, l < L -> k < S n -> low_holds (a + k) l = true -> so_far (S k) <= longest l).
  { intros k l Hl Hk E. apply (runs_end rules a (S k) l Hl). intros i Hi. split; [apply W; lia|].
    apply (ran_before a k l Hl); auto. intros; apply W; lia. }
  assert (Few : forall k, k < S n -> low (a + k) <= few).
  { intros k Hk. apply Nat.le_trans with (2 := Q). apply sum_le. intros l Hl.
    destruct (low_holds (a + k) l) eqn:E; simpl; [|lia].
    pose proof (ran_before a k l Hl ltac:(intros; apply W; lia) E 0 ltac:(lia)) as B.
    rewrite Nat.add_0_r in B. rewrite B. simpl. lia. }
  assert (H : forall k, k <= S n ->
    sum k (fun i => counted (a + i)) + (few * (level' - so_far k)
    + sum L (fun l => if (match k with 0 => true | S p => low_holds (a + p) l end)
                      then longest l - Nat.max level' (so_far k) else 0))
    <= largest few level' L longest).
  { induction k; intros Hk.
    - unfold largest. cbn [sum]. change (so_far 0) with 0. rewrite Nat.sub_0_r, Nat.max_0_r. apply Nat.le_refl.
    - specialize (IHk ltac:(lia)). cbn [sum]. rewrite Next.
      pose (before := fun l => match k with 0 => true | S p => low_holds (a + p) l end).
      change (sum k (fun i => counted (a + i)) + (few * (level' - so_far k)
        + sum L (fun l => if before l then longest l - Nat.max level' (so_far k) else 0))
        <= largest few level' L longest) in IHk.
      assert (Bef : forall l, l < L -> low_holds (a + k) l = true -> before l = true).
      { intros l Hl E. unfold before. destruct k as [|p]; auto.
        apply (ran_before a (S p) l Hl); auto. intros; apply W; lia. }
      unfold counted at 2. specialize (Long k). rewrite Next in Long. destruct (skip (a + k)).
      + simpl Nat.b2n. rewrite !Nat.add_0_r. apply Nat.le_trans with (2 := IHk).
        apply Nat.add_le_mono_l, Nat.add_le_mono_l. apply sum_le. intros l Hl.
        destruct (low_holds (a + k) l) eqn:E; [|lia]. rewrite (Bef l Hl E). lia.
      + simpl Nat.b2n in *. rewrite Nat.add_1_r in *.
        pose proof (one_tick_of_blocking few level' (so_far k) (Nat.min (low (a + k)) m) before
          (low_holds (a + k))) as O.
        specialize (O ltac:(specialize (Few k ltac:(lia)); lia) ltac:(unfold low; lia)).
        specialize (O ltac:(intros l Hl E; split; [apply Bef; auto|apply (Long l Hl ltac:(lia) E)])).
        cbv beta in O. lia. }
  specialize (H (S n) (le_n _)). apply Nat.le_trans with (2 := H). apply Nat.le_add_r.
Qed.

Lemma waits_first a d v : v < size G -> on v = true -> (forall i, i <= d -> ready G s (a + i) v) -> done s a v = 0 ->
  exists n, n <= d /\ (forall i, i < n -> waits (a + i) = true) /\
    (forall i, n <= i < d -> skip (a + i) = true \/ runs s (a + i) v = true).
Proof.
  intros Hv O Rd Z.
  assert (H : exists n, n <= d /\ (forall i, i < n -> runs s (a + i) v = false) /\
    (n = d \/ runs s (a + n) v = true)).
  { clear Rd. induction d; [exists 0; split; [lia|split; [intros; lia|auto]]|].
    destruct IHd as (n & Hn & H1 & [->|H2]).
    - destruct (runs s (a + d) v) eqn:E.
      + exists d. split; [lia|]. auto.
      + exists (S d). split; [lia|]. split; [|auto]. intros i Hi.
        destruct (Nat.eq_dec i d) as [->|]; auto. apply H1. lia.
    - exists n. split; [lia|]. auto. }
  destruct H as (n & Hn & H1 & H2). exists n. split; [auto|]. split.
  - intros i Hi. apply waits_to_begin_true. exists v. split; [apply Rd; lia|]. split; [|apply H1; auto].
    unfold done, count in *. rewrite sum_shift, Z. apply sum_zero. intros k Hk. rewrite H1; auto. lia.
  - intros i Hi. destruct (skip (a + i)) eqn:Sk; auto. right.
    destruct H2 as [->|H2]; [lia|]. destruct (Nat.eq_dec i n) as [->|Ne]; auto.
    destruct (Rd i ltac:(lia)) as (_ & N & _). apply (own_keep rules); auto.
    pose proof (done_monotone s (S (a + n)) (a + i) v ltac:(lia)) as M. rewrite done_next, H2 in M.
    simpl in M. lia.
Qed.

(** What one vertex waits, from when it becomes ready. *)
Lemma one_wait few level' a d v : v < size G -> on v = true -> (forall i, i <= d -> ready G s (a + i) v) ->
  done s a v = 0 -> (waits a = true -> low a <= few) ->
  sum d (fun i => if runs s (a + i) v then 0 else counted (a + i)) <= largest few level' L longest.
Proof.
  intros Hv O Rd Z Q. destruct (waits_first a d v Hv O Rd Z) as (n & Hn & W & H2).
  replace d with (n + (d - n)) by lia. rewrite sum_shift.
  rewrite (sum_zero (d - n)).
  2: { intros i Hi. unfold counted. destruct (H2 (n + i) ltac:(lia)) as [->| ->]; [|auto].
       destruct (runs s (a + (n + i)) v); auto. }
  rewrite Nat.add_0_r.
  apply Nat.le_trans with (sum n (fun i => counted (a + i))).
  - apply sum_le. intros i Hi. destruct (runs s (a + i) v); lia.
  - apply one_stretch; auto. intros Hn0. apply Q. specialize (W 0 Hn0). rewrite Nat.add_0_r in W. auto.
Qed.

Definition after_wait (v : nat) : bool := existsb (fun u => edge G u v && negb (on u)) (seq 0 (size G)).

Notation every := (largest m level0 L longest).
Notation later := (largest (m - 1) level1 L longest).

Definition blocked_at (v : nat) : nat := if on v then if after_wait v then every else later else 0.

Lemma waits_never_wait a d v : on v = false -> (forall i, i <= d -> ready G s (a + i) v) ->
  sum d (fun i => if runs s (a + i) v then 0 else counted (a + i)) = 0.
Proof. intros O Rd. apply sum_zero. intros i Hi. rewrite (waits_run rules _ v O); auto. apply Rd. lia. Qed.

Lemma blocked_at_release d v : v < size G -> (forall i, i <= d -> ready G s i v) ->
  sum d (fun i => if runs s (0 + i) v then 0 else counted (0 + i)) <= every - later + blocked_at v.
Proof.
  intros Hv Rd. unfold blocked_at. destruct (on v) eqn:O; [|rewrite waits_never_wait; auto; lia].
  apply Nat.le_trans with every; [|destruct (after_wait v); lia].
  apply one_wait; auto. intros _. pose proof (m_cores rules 0). lia.
Qed.

Lemma blocked_later p d v : v < size G -> (forall i, i <= d -> ready G s (S p + i) v) -> ~ ready G s p v ->
  sum d (fun i => if runs s (S p + i) v then 0 else counted (S p + i)) <= blocked_at v.
Proof.
  intros Hv Rd Np. unfold blocked_at. destruct (on v) eqn:O; [|rewrite waits_never_wait; auto].
  assert (Rv : ready G s (S p) v) by (specialize (Rd 0 ltac:(lia)); rewrite Nat.add_0_r in Rd; exact Rd).
  destruct (becomes_ready_after G s p v Rv Np) as (u & Hu & Eu & Nu & Ru).
  pose proof (not_begun G m s (obeys rules) p u v Hv Eu Nu) as Z.
  destruct (after_wait v) eqn:Af.
  { apply one_wait; auto. intros _. pose proof (m_cores rules (S p)). lia. }
  assert (No : forall w, edge G w v = true -> on w = true).
  { intros w E. destruct (on w) eqn:Ow; auto. exfalso. pose proof (edges_lead_up _ _ _ E).
    assert (after_wait v = true); [|congruence]. apply existsb_exists. exists w. rewrite in_seq, E, Ow. split; [lia|auto]. }
  (* so the predecessor that ends is a segment, and leaves a core *)
  assert (Ou : on u = true).
  { inversion Eu as [? E|w ? Uw E]; subst; [apply No, E|]. exfalso. pose proof (edges_lead_up _ _ _ E).
    pose proof (not_begun G m s (obeys rules) p u w ltac:(lia) Uw Nu). destruct Rv as (_ & _ & P).
    specialize (P w (precedes_edge _ _ _ E)). pose proof (takes_time rules w ltac:(lia) (No w E)). unfold finished in P. lia. }
  apply one_wait; auto. intros W.
  assert (Less : low (S p) <= low p).
  { apply sum_le. intros l Hl. destruct (low_holds (S p) l) eqn:E; simpl; [|lia].
    rewrite (no_start rules p l Hl W E). simpl. lia. }
  pose proof (m_cores rules p). pose proof (sum_term (size G) (fun v => Nat.b2n (on v && runs s p v)) u Hu) as T.
  cbv beta in T. rewrite Ou, Ru in T. simpl Nat.b2n in T. unfold own_cores, count in *. lia.
Qed.

End path.

(** ** Blocking as often as subtasks have a predecessor *)

Hypothesis without_waits : all_on.
Variables (j level0 level1 : nat).
Let q0 := m - j.
Let q1 := Nat.min (m - j) (m - 1).
Let q t := if waited t =? t then q0 else q1.
Let level t := if waited t =? t then level0 else level1.
Let counts t := if skip t then 0 else Nat.min (low t) (m - j).
Let blocked r := sum r (fun t => if waits t then counts t else 0).
Let older t := age t + Nat.b2n (negb (skip t)).
Let rest t := q t * (level t - older t)
  + sum L (fun l => if low_holds t l then longest l - Nat.max (level t) (older t) else 0).
Let limit r := largest q0 level0 L longest + largest q1 level1 L longest * count r begins.

Lemma at_most_q t : waits t = true -> Nat.min (low t) (m - j) <= q t.
Proof.
  intros W. unfold q, q0, q1. destruct (Nat.eqb_spec (waited t) t) as [E|E]; [lia|].
  assert (Le : forall t, waited t <= t) by (clear; induction t; simpl; [|destruct (waits t)]; lia).
  pose proof (fewer_low t without_waits W ltac:(specialize (Le t); lia)). lia.
Qed.

(** A tick of a stretch. *)
Lemma tick_of_stretch t (before : nat -> bool) : waits t = true ->
  (forall l, l < L -> low_holds t l = true -> before l = true) ->
  counts t + rest t <= q t * (level t - age t)
    + sum L (fun l => if before l then longest l - Nat.max (level t) (age t) else 0).
Proof.
  intros W Bef. unfold counts, rest, older. destruct (skip t) eqn:Sk.
  - simpl Nat.b2n. rewrite Nat.add_0_r, Nat.add_0_l. apply Nat.add_le_mono_l. apply sum_le. intros l Hl.
    destruct (low_holds t l) eqn:E; [|lia]. rewrite (Bef l Hl E). lia.
  - simpl Nat.b2n. rewrite Nat.add_1_r.
    pose proof (one_tick_of_blocking (q t) (level t) (age t) (Nat.min (low t) (m - j)) before (low_holds t)
      (at_most_q t W) ltac:(unfold low; lia)) as O.
    specialize (O ltac:(intros l Hl E; split; [auto|]; pose proof (long_enough t l Hl W E) as B;
      rewrite Sk in B; simpl in B; lia)).
    lia.
Qed.

Lemma first_tick t : waits t = true -> waited t = 0 ->
  counts t + rest t <= largest (q t) (level t) L longest.
Proof.
  intros W Z.
  assert (A : age t = 0).
  { destruct t as [|p]; auto. simpl in Z |- *. destruct (waits p); [discriminate|auto]. }
  pose proof (tick_of_stretch t (fun _ => true) W ltac:(auto)) as T. rewrite A in T. cbv beta iota in T.
  rewrite Nat.sub_0_r, Nat.max_0_r in T. exact T.
Qed.

Lemma blocked_so_far t : blocked (S t) + (if waits t then rest t else 0) <= limit (S t).
Proof.
  induction t.
  - unfold blocked, limit. cbn [sum]. destruct (waits 0) eqn:W; [|lia].
    pose proof (first_tick 0 W eq_refl) as F. unfold q, level in F. simpl waited in F. simpl Nat.eqb in F.
    cbv iota in F. lia.
  - assert (Eb : blocked (S (S t)) = blocked (S t) + (if waits (S t) then counts (S t) else 0))
      by reflexivity.
    assert (El : limit (S (S t)) = limit (S t) + largest q1 level1 L longest * Nat.b2n (begins (S t))).
    { unfold limit, count. cbn [sum]. rewrite Nat.mul_add_distr_l. lia. }
    rewrite Eb, El. destruct (waits (S t)) eqn:W; [|destruct (waits t); lia].
    destruct (waits t) eqn:Wt.
    + (* the stretch goes on *)
      assert (Ew : waited (S t) = S (waited t)) by (simpl; rewrite Wt; reflexivity).
      assert (Ea : age (S t) = older t) by (simpl; rewrite Wt; reflexivity).
      assert (Eq : q (S t) = q t).
      { unfold q. rewrite Ew. destruct (Nat.eqb_spec (S (waited t)) (S t)), (Nat.eqb_spec (waited t) t); lia. }
      assert (Ev : level (S t) = level t).
      { unfold level. rewrite Ew.
        destruct (Nat.eqb_spec (S (waited t)) (S t)), (Nat.eqb_spec (waited t) t); lia. }
      pose proof (tick_of_stretch (S t) (low_holds t) W ltac:(intros l Hl E; apply (no_start rules); auto)) as T.
      rewrite Ea, Eq, Ev in T. fold (rest t) in T. lia.
    + (* a stretch begins *)
      assert (Ew : waited (S t) = 0) by (simpl; rewrite Wt; reflexivity).
      pose proof (first_tick (S t) W Ew) as F.
      assert (Eq : q (S t) = q1) by (unfold q; rewrite Ew; reflexivity).
      assert (Ev : level (S t) = level1) by (unfold level; rewrite Ew; reflexivity).
      assert (Es : begins (S t) = true) by (unfold begins; rewrite W, Ew; reflexivity).
      rewrite Eq, Ev in F. rewrite Es. simpl Nat.b2n. lia.
Qed.

(** *Lower-ranked work blocks by at most the m - j largest of it, and once more for each vertex with a
    predecessor, by the m - max(j, 1) largest.*  Each sum of largest is stated by a [level]. *)
Definition blocking : nat :=
  largest (m - j) level0 L longest
  + count (size G) (has_predecessor G) * largest (Nat.min (m - j) (m - 1)) level1 L longest.

Lemma blocked_at_most r : blocked r <= blocking.
Proof.
  destruct r as [|t]; [unfold blocked; simpl; lia|].
  pose proof (blocked_so_far t) as B. pose proof (few_stretches (S t)) as F.
  unfold limit in B. unfold blocking.
  change (Nat.min (m - j) (m - 1)) with q1. change (m - j) with q0.
  assert (largest q1 level1 L longest * count (S t) begins
          <= count (size G) (has_predecessor G) * largest q1 level1 L longest).
  { rewrite Nat.mul_comm. apply Nat.mul_le_mono_r, F. }
  lia.
Qed.

(** ** The first form with blocking *)
Theorem first_form_blocked c len f r I :
  within_wcet G s c -> no_path_longer G c len -> disjoint_chains G j f -> j < m ->
  sum r (fun t => Nat.min (high t) (m - j)) <= I ->
  len <= r -> left_over G c j f + I + blocking <= (m - j) * (r - len) ->
  complete G s r.
Proof.
  intros W Len D Hj HI Hr H.
  destruct (complete_or_not G s r) as [C|(v & Hv & F)]; auto. exfalso.
  assert (LenK : forall k, chain G k -> weight G c k <= len)
    by (intros; apply chain_at_most_length; auto).
  destruct (account G m s c len j f (obeys rules) W LenK D r) as (w & W1 & W2 & W3).
  { intros C. apply F, C, Hv. }
  assert (S1 : sum r (fun t => if w t then Nat.min (others s t) (m - j) else 0)
    <= sum r (fun t => Nat.min (high t) (m - j)) + blocked r).
  { unfold blocked, counts. rewrite <- sum_plus. apply sum_le. intros t Ht.
    destruct (w t) eqn:E; [|lia]. specialize (W1 t Ht E). pose proof (others_are rules t).
    destruct (skip t) eqn:Sk; [lia|]. rewrite (waits_or_skip t W1 Sk). lia. }
  pose proof (blocked_at_most r) as S2.
  assert (S3 : (m - j) * (r - len + 1) <= (m - j) * count r w) by (apply Nat.mul_le_mono_l; lia).
  rewrite Nat.mul_add_distr_l in S3. lia.
Qed.

End blocking.



(** * Bounds on the response time of a DAG *)

Require Import Arith Lia Bool List.
From Bounds Require Import Sums Model Chains OneTick Account.

Lemma floor_step a b : 0 < b -> a < b * (a / b + 1).
Proof.
  intros H. pose proof (Nat.div_mod a b ltac:(lia)). pose proof (Nat.mod_upper_bound a b ltac:(lia)).
  lia.
Qed.

(** The general form, from which the others follow, with the length as a bound on chains.  It is strict
    because a job that is not complete at r has some of its length left. *)
Lemma complete_if_account G m s c len j f r :
  legal G m s -> within_wcet G s c ->
  (forall k, chain G k -> weight G c k <= len) ->
  disjoint_chains G j f ->
  left_over G c j f + sum r (fun t => Nat.min (others s t) (m - j)) < (m - j) * (r + 1 - len) ->
  complete G s r.
Proof.
  intros L W Len D H.
  destruct (complete_or_not G s r) as [C|(v & Hv & F)]; auto. exfalso.
  destruct (account G m s c len j f L W Len D r) as (w & _ & W2 & W3).
  { intros C. apply F, C, Hv. }
  assert ((m - j) * (r + 1 - len) <= (m - j) * count r w) by (apply Nat.mul_le_mono_l; lia).
  assert (sum r (fun t => if w t then Nat.min (others s t) (m - j) else 0)
          <= sum r (fun t => Nat.min (others s t) (m - j))).
  { apply sum_le. intros t _. destruct (w t); lia. }
  lia.
Qed.

(** ** 1. Graham's bound

    *A DAG alone on m cores is complete after length + (volume - length) / m ticks, rounded down.*

    For every order in which a work-conserving scheduler takes ready vertices, with or without preemption
    (runs are arbitrary sets of ready vertices, tick by tick), and for all executions up to the WCETs:
    the rule of work conservation is all that is used, so anomalies cannot break it.

    Rounding down is right because all that happens happens at whole ticks.  [graham_in_fractions]
    below is the form that does not depend on that. *)
Theorem graham G m s c len :
  0 < m -> legal G m s -> alone s -> within_wcet G s c -> no_path_longer G c len ->
  complete G s (len + (volume G c - len) / m).
Proof.
  intros Hm L Al W Len.
  set (r := len + (volume G c - len) / m).
  destruct (complete_or_not G s r) as [C|(v & Hv & F)]; auto. exfalso.
  assert (LenK : forall k, chain G k -> weight G c k <= len)
    by (intros; apply chain_at_most_length; auto).
  apply (longest_exists G c). intros (k & Ck & Mk).
  apply F, (complete_if_account G m s c (weight G c k) 0 (fun v => if k v then 0 else 1)); auto.
  - intros a b H Hb E Lb. destruct (k a) eqn:Ka, (k b) eqn:Kb; try lia. apply Ck; auto.
  - assert (Z : sum r (fun t => Nat.min (others s t) (m - 0)) = 0).
    { apply sum_zero. intros t _. rewrite Al. auto. }
    rewrite Z.
    assert (V : left_over G c 0 (fun v => if k v then 0 else 1) + weight G c k = volume G c).
    { unfold left_over, weight, volume. rewrite <- sum_plus. apply sum_ext. intros u _.
      destruct (k u); simpl; lia. }
    specialize (LenK k Ck). rewrite Nat.sub_0_r.
    pose proof (floor_step (volume G c - len) m Hm) as Fl.
    set (q := (volume G c - len) / m) in *.
    assert (m * (r + 1 - weight G c k) = m * (q + 1) + m * (len - weight G c k)).
    { rewrite <- Nat.mul_add_distr_l. f_equal. unfold r. fold q. lia. }
    assert (len - weight G c k <= m * (len - weight G c k)) by nia.
    lia.
Qed.

(** ** 2. The multi-path bound of a DAG alone

    *Take any j + 1 disjoint chains, j < m.  A DAG alone on m cores is complete after its length, and
    what is left over besides these chains, divided by m - j and rounded down.*

    It holds for each j and each family of chains, so the least of these values is a bound, too.  The
    chains need not hold a longest path, and may be found in any way.  With j = 0 and a longest path as the
    only chain it is Graham's bound. *)
Theorem multi_path_alone G m s c len j f :
  j < m -> legal G m s -> alone s -> within_wcet G s c -> no_path_longer G c len ->
  disjoint_chains G j f ->
  complete G s (len + left_over G c j f / (m - j)).
Proof.
  intros Hj L Al W Len D.
  apply (complete_if_account G m s c len j f); auto.
  - intros k Ck. apply chain_at_most_length; auto.
  - rewrite sum_zero by (intros; rewrite Al; auto).
    pose proof (floor_step (left_over G c j f) (m - j) ltac:(lia)).
    replace (len + left_over G c j f / (m - j) + 1 - len)
      with (left_over G c j f / (m - j) + 1) by lia.
    lia.
Qed.

(** ** 3. Among others: the first form, (U)

    *Let others execute I at most on at most m - j cores in the first r ticks of the job (what they execute
    on more cores at once does not count).  If (m - j) (r - length) is at least what is left over
    besides j + 1 disjoint chains and I together, the job is complete at r.*

    Others are any work whatsoever; it may preempt the job at any time. *)
Theorem first_form G m s c len j f r I :
  j < m -> legal G m s -> within_wcet G s c -> no_path_longer G c len -> disjoint_chains G j f ->
  sum r (fun t => Nat.min (others s t) (m - j)) <= I ->
  len <= r -> left_over G c j f + I <= (m - j) * (r - len) ->
  complete G s r.
Proof.
  intros Hj L W Len D HI Hr H.
  apply (complete_if_account G m s c len j f); auto.
  - intros k Ck. apply chain_at_most_length; auto.
  - assert ((m - j) * (r + 1 - len) = (m - j) * (r - len) + (m - j)) by nia. lia.
Qed.

(** The same in whole ticks, one tick sharper: (m - j) (r + 1 - length) need only be *above* the sum.
    This is the form that rounds down. *)
Theorem first_form_in_ticks G m s c len j f r I :
  legal G m s -> within_wcet G s c -> no_path_longer G c len -> disjoint_chains G j f ->
  sum r (fun t => Nat.min (others s t) (m - j)) <= I ->
  left_over G c j f + I < (m - j) * (r + 1 - len) ->
  complete G s r.
Proof.
  intros L W Len D HI H.
  apply (complete_if_account G m s c len j f); auto.
  - intros k Ck. apply chain_at_most_length; auto.
  - lia.
Qed.

(** A bound [I] for all windows of a length, as analyses state it; the job's is one of them.
    With j = 0 this is the equation of Graham and Melani: m (r - length) >= volume - length + I(r). *)
Theorem response_time_equation G m s c len j f r (I : nat -> nat) :
  j < m -> legal G m s -> within_wcet G s c -> no_path_longer G c len -> disjoint_chains G j f ->
  (forall a l, sum l (fun t => Nat.min (others s (a + t)) (m - j)) <= I l) ->
  len <= r -> left_over G c j f + I r <= (m - j) * (r - len) ->
  complete G s r.
Proof.
  intros Hj L W Len D HI Hr H.
  apply (first_form G m s c len j f r (I r)); auto. apply (HI 0 r).
Qed.

(** ** 4. Among others: the second form

    Others are K tasks; [other k t] is how many cores execute task k in tick t.  [phi k n] bounds what task k
    executes in any n of the first r ticks, on at most m - j cores at a time.  [phi k] must not grow faster
    than in proportion, as every concave function does that is 0 or more at 0.

    *If (m - j) x is at least max(1, what is left over) and the sum of all phi k x, with x = r - length,
    the job is complete at r.*  Or if it is above what is left over and the sum, with x + 1 for x: *)
Theorem second_form_sharp G m s c len j f r K (other : nat -> nat -> nat) (phi : nat -> nat -> nat) :
  legal G m s -> within_wcet G s c -> no_path_longer G c len -> disjoint_chains G j f ->
  (forall t, t < r -> others s t <= sum K (fun k => other k t)) ->
  (forall k w, k < K ->
    sum r (fun t => if (w t : bool) then Nat.min (other k t) (m - j) else 0) <= phi k (count r w)) ->
  (forall k a b, k < K -> a <= b -> a * phi k b <= b * phi k a) ->
  len <= r ->
  left_over G c j f + sum K (fun k => phi k (r - len + 1)) < (m - j) * (r - len + 1) ->
  complete G s r.
Proof.
  intros L W Len D Ho Hphi Hprop Hr H.
  destruct (complete_or_not G s r) as [C|(v & Hv & F)]; auto. exfalso.
  assert (LenK : forall k, chain G k -> weight G c k <= len)
    by (intros; apply chain_at_most_length; auto).
  destruct (account G m s c len j f L W LenK D r) as (w & _ & W2 & W3).
  { intros C. apply F, C, Hv. }
  set (X := count r w) in *. set (x := r - len + 1) in *. set (B := left_over G c j f) in *.
  assert (HX : x <= X) by lia.
  (* what others execute in the ticks waited in *)
  assert (S1 : sum r (fun t => if w t then Nat.min (others s t) (m - j) else 0)
               <= sum K (fun k => phi k X)).
  { apply Nat.le_trans
      with (sum r (fun t => sum K (fun k => if w t then Nat.min (other k t) (m - j) else 0))).
    - apply sum_le. intros t Ht. destruct (w t).
      + specialize (Ho t Ht). pose proof (min_sum K (fun k => other k t) (m - j)). lia.
      + rewrite sum_zero; auto.
    - rewrite sum_swap. apply sum_le. intros k Hk. apply Hphi; auto. }
  (* in proportion, x ticks would allow no more *)
  assert (S2 : x * sum K (fun k => phi k X) <= X * sum K (fun k => phi k x)).
  { rewrite <- !sum_times. apply sum_le. intros k Hk. apply Hprop; auto. }
  set (Px := sum K (fun k => phi k x)) in *. set (PX := sum K (fun k => phi k X)) in *.
  assert (S3 : (m - j) * X <= B + PX) by lia.
  assert (S4 : x * ((m - j) * X) <= x * (B + PX)) by (apply Nat.mul_le_mono_l, S3).
  rewrite Nat.mul_add_distr_l in S4.
  assert (S5 : x * B <= X * B) by (apply Nat.mul_le_mono_r, HX).
  assert (S6 : X * (B + Px) < X * ((m - j) * x)) by (apply Nat.mul_lt_mono_pos_l; lia).
  rewrite Nat.mul_add_distr_l in S6.
  assert (S7 : x * ((m - j) * X) = X * ((m - j) * x)) by lia.
  lia.
Qed.

(** The published form, which does not look one tick further.  [second_form_sharp] gives more where nothing is
    left over: if left + sum of phi k x is at most (m - j) x, it is enough that from x to x + 1 the sum of the
    phi grows by less than m - j: in fractions, by their slope there ([second_inequality]). *)
Lemma one_tick_further K (phi : nat -> nat -> nat) left p x :
  (forall k a b, k < K -> a <= b -> a * phi k b <= b * phi k a) ->
  Nat.max 1 left + sum K (fun k => phi k x) <= p * x ->
  left + sum K (fun k => phi k (x + 1)) < p * (x + 1).
Proof.
  intros Hprop H.
  assert (S2 : x * sum K (fun k => phi k (x + 1)) <= (x + 1) * sum K (fun k => phi k x)).
  { rewrite <- !sum_times. apply sum_le. intros k Hk. apply Hprop; auto. lia. }
  set (Px := sum K (fun k => phi k x)) in *. set (PX := sum K (fun k => phi k (x + 1))) in *.
  destruct (Nat.eq_dec x 0) as [Z|Z]; [rewrite Z in H; lia|].
  apply (Nat.mul_lt_mono_pos_l x); [lia|].
  assert (S3 : (x + 1) * (Nat.max 1 left + Px) <= (x + 1) * (p * x)) by (apply Nat.mul_le_mono_l, H).
  rewrite Nat.mul_add_distr_l in S3 |- *.
  assert (S4 : x * left + 1 <= (x + 1) * Nat.max 1 left).
  { assert (x * left <= x * Nat.max 1 left) by (apply Nat.mul_le_mono_l; lia).
    rewrite Nat.mul_add_distr_r. lia. }
  assert (S5 : x * (p * (x + 1)) = (x + 1) * (p * x)) by lia.
  lia.
Qed.

Theorem second_form G m s c len j f r K (other : nat -> nat -> nat) (phi : nat -> nat -> nat) :
  legal G m s -> within_wcet G s c -> no_path_longer G c len -> disjoint_chains G j f ->
  (forall t, t < r -> others s t <= sum K (fun k => other k t)) ->
  (forall k w, k < K ->
    sum r (fun t => if (w t : bool) then Nat.min (other k t) (m - j) else 0) <= phi k (count r w)) ->
  (forall k a b, k < K -> a <= b -> a * phi k b <= b * phi k a) ->
  len <= r ->
  Nat.max 1 (left_over G c j f) + sum K (fun k => phi k (r - len)) <= (m - j) * (r - len) ->
  complete G s r.
Proof.
  intros L W Len D Ho Hphi Hprop Hr H.
  apply (second_form_sharp G m s c len j f r K other phi); auto. apply one_tick_further; auto.
Qed.

(** *** What phi may be: the three terms of the product's f_i(X) *)

(** The least of two such functions is one, and so is the sum of many. *)
Lemma in_proportion_min f g a b :
  a * f b <= b * f a -> a * g b <= b * g a -> a * Nat.min (f b) (g b) <= b * Nat.min (f a) (g a).
Proof. intros H1 H2. destruct (Nat.min_spec (f a) (g a)) as [(_ & ->)|(_ & ->)]; nia. Qed.

(** [phi n = min(W, p n, sum over chains of min(W_chain, n) + min(W_rest, p n))]: a task that executes W at
    most in the first r ticks, on p cores at most at a time, and that consists of [N] chains, of which chain i
    is on one core at a time and executes [Wc i] at most, and a rest that executes [Wrest] at most. *)
Definition clipped (W p N : nat) (Wc : nat -> nat) (Wrest n : nat) : nat :=
  Nat.min W (Nat.min (p * n) (sum N (fun i => Nat.min (Wc i) n) + Nat.min Wrest (p * n))).

Lemma clipped_in_proportion W p N Wc Wrest a b :
  a <= b -> a * clipped W p N Wc Wrest b <= b * clipped W p N Wc Wrest a.
Proof.
  intros H. unfold clipped.
  apply (in_proportion_min (fun _ => W)
    (fun n => Nat.min (p * n) (sum N (fun i => Nat.min (Wc i) n) + Nat.min Wrest (p * n)))).
  { nia. }
  apply (in_proportion_min (fun n => p * n)
    (fun n => sum N (fun i => Nat.min (Wc i) n) + Nat.min Wrest (p * n))).
  { nia. }
  rewrite !Nat.mul_add_distr_l. apply Nat.add_le_mono.
  - rewrite <- !sum_times. apply sum_le. intros i _.
    apply (in_proportion_min (fun _ => Wc i) (fun n => n)); nia.
  - apply (in_proportion_min (fun _ => Wrest) (fun n => p * n)); nia.
Qed.

(** How much [clipped] grows at most right after n, per unit of time however short, as far as comparisons tell. *)
Definition rise (W p N : nat) (Wc : nat -> nat) (Wrest n : nat) : nat :=
  let sums := sum N (fun i => Nat.min (Wc i) n) + Nat.min Wrest (p * n) in
  let chains := sum N (fun i => if n <? Wc i then 1 else 0) + (if p * n <? Wrest then p else 0) in
  if W <=? Nat.min (p * n) sums then 0
  else if p * n <? sums then p else if sums <? p * n then chains else Nat.min p chains.

Lemma clipped_further W p N Wc Wrest n :
  clipped W p N Wc Wrest (n + 1) <= clipped W p N Wc Wrest n + rise W p N Wc Wrest n.
Proof.
  unfold clipped, rise. cbv zeta.
  assert (S : sum N (fun i => Nat.min (Wc i) (n + 1))
    <= sum N (fun i => Nat.min (Wc i) n) + sum N (fun i => if n <? Wc i then 1 else 0)).
  { rewrite <- sum_plus. apply sum_le. intros i _. destruct (Nat.ltb_spec n (Wc i)); lia. }
  rewrite Nat.mul_add_distr_l, Nat.mul_1_r.
  generalize dependent (sum N (fun i => Nat.min (Wc i) (n + 1))).
  generalize (sum N (fun i => Nat.min (Wc i) n)), (sum N (fun i => if n <? Wc i then 1 else 0)), (p * n).
  intros a b c d S. destruct (Nat.ltb_spec c Wrest), (Nat.leb_spec W (Nat.min c (a + Nat.min Wrest c))),
    (Nat.ltb_spec c (a + Nat.min Wrest c)), (Nat.ltb_spec (a + Nat.min Wrest c) c); lia.
Qed.

Lemma clipped_is_bound r W p N Wc Wrest (cores rest : nat -> nat) (on : nat -> nat -> nat) w :
  sum r cores <= W ->
  (forall t, t < r -> cores t <= p) ->
  (forall t, t < r -> cores t <= sum N (fun i => on i t) + rest t) ->
  (forall i t, i < N -> t < r -> on i t <= 1) ->
  (forall i, i < N -> sum r (on i) <= Wc i) ->
  (forall t, t < r -> rest t <= p) ->
  sum r rest <= Wrest ->
  sum r (fun t => if (w t : bool) then cores t else 0) <= clipped W p N Wc Wrest (count r w).
Proof.
  intros HW Hp Hc H1 Hi Hrp Hr. unfold clipped.
  apply Nat.min_glb; [|apply Nat.min_glb].
  - apply Nat.le_trans with (sum r cores); auto. apply sum_le. intros t _. destruct (w t); lia.
  - unfold count. rewrite <- sum_times. apply sum_le. intros t Ht. specialize (Hp t Ht).
    destruct (w t); simpl; lia.
  - apply Nat.le_trans
      with (sum r (fun t => sum N (fun i => if w t then on i t else 0))
            + sum r (fun t => if w t then rest t else 0)).
    + rewrite <- sum_plus. apply sum_le. intros t Ht. specialize (Hc t Ht). destruct (w t); lia.
    + apply Nat.add_le_mono.
      * rewrite sum_swap. apply sum_le. intros i Hi'. apply Nat.min_glb.
        -- apply Nat.le_trans with (sum r (on i)); auto. apply sum_le. intros t _.
           destruct (w t); lia.
        -- apply sum_le. intros t Ht. specialize (H1 i t Hi' Ht). destruct (w t); simpl; lia.
      * apply Nat.min_glb.
        -- apply Nat.le_trans with (sum r rest); auto. apply sum_le. intros t _.
           destruct (w t); lia.
        -- unfold count. rewrite <- sum_times. apply sum_le. intros t Ht. specialize (Hrp t Ht).
           destruct (w t); simpl; lia.
Qed.

(** ** 5. Fractions of a tick

    Schedules of the machine change at any instant.  Let the bound be stated in ns, and a tick be 1/N of
    a ns: then executions are up to [N * c v] ticks, and others execute [N * I] ticks.  *The inequality
    in ns, with the division rounded up, is right for each N*: no resolution of time breaks it. *)
Theorem first_form_in_fractions N G m s c len j f r I :
  0 < N -> j < m -> legal G m s -> within_wcet G s (fun v => N * c v) ->
  no_path_longer G c len -> disjoint_chains G j f ->
  sum (N * r) (fun t => Nat.min (others s t) (m - j)) <= N * I ->
  len <= r -> left_over G c j f + I <= (m - j) * (r - len) ->
  complete G s (N * r).
Proof.
  intros HN Hj L W Len D HI Hr H.
  apply (first_form G m s (fun v => N * c v) (N * len) j f (N * r) (N * I)); auto.
  - intros l P. specialize (Len l P). unfold path_length in *.
    assert (E : list_sum (map (fun v => N * c v) l) = N * list_sum (map c l)).
    { clear. induction l; simpl; [lia|]. rewrite IHl. lia. }
    rewrite E. apply Nat.mul_le_mono_l, Len.
  - apply Nat.mul_le_mono_l, Hr.
  - assert (E : left_over G (fun v => N * c v) j f = N * left_over G c j f).
    { unfold left_over. rewrite <- sum_times. apply sum_ext. intros v _.
      destruct (f v <=? j); lia. }
    rewrite E, <- Nat.mul_sub_distr_l. nia.
Qed.

(** Alone, in fractions: the division rounds up. *)
Theorem multi_path_alone_in_fractions N G m s c len j f r :
  0 < N -> j < m -> legal G m s -> alone s -> within_wcet G s (fun v => N * c v) ->
  no_path_longer G c len -> disjoint_chains G j f ->
  len <= r -> left_over G c j f <= (m - j) * (r - len) ->
  complete G s (N * r).
Proof.
  intros HN Hj L Al W Len D Hr H.
  apply (first_form_in_fractions N G m s c len j f r 0); auto; [|lia].
  rewrite sum_zero; [lia|]. intros t _. rewrite Al. auto.
Qed.








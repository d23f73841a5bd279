(** * What one tick does to the longest chain and to the best family of chains

    The heart of the multi-path bound (docs/bounds.md, "The lemma"), in ticks: if the length of
    what remains does not fall in a tick, then every core is busy, and what is left over besides j + 1
    disjoint chains falls by the number of the job's cores less j, at least. *)

Require Import Arith Lia Bool List.
From Bounds Require Import Sums Model Chains.

(** [k] is a heaviest chain, [f] a family of chains that leaves the least. *)
Definition longest (G : dag) (x : nat -> nat) (k : nat -> bool) : Prop :=
  chain G k /\ forall k', chain G k' -> weight G x k' <= weight G x k.

Definition best (G : dag) (x : nat -> nat) (j : nat) (f : nat -> nat) : Prop :=
  disjoint_chains G j f /\ forall f', disjoint_chains G j f' -> left_over G x j f <= left_over G x j f'.

(** Both exist, as far as inequalities are concerned. *)
Lemma longest_exists G x : ~ ~ exists k, longest G x k.
Proof.
  intros N.
  apply (greatest_exists _ (chain G) (weight G x) (volume G x) (fun _ => false)).
  - intros u v _ _ H. discriminate.
  - intros k _. apply weight_at_most_volume.
  - intros (k & H). apply N. exists k. exact H.
Qed.

Lemma best_exists G x j : ~ ~ exists f, best G x j f.
Proof.
  intros N.
  apply (smallest_exists _ (disjoint_chains G j) (left_over G x j) (fun _ => S j)).
  - intros u v _ _ _ H. lia.
  - intros (f & H). apply N. exists f. exact H.
Qed.

Section one_tick.
Variables (G : dag) (m : nat) (s : run).
Hypothesis rules : legal G m s.
Variable t : nat.

Notation x := (remaining s t).
Notation x' := (remaining s (S t)).
Notation A := (runs s t).

Lemma next_v v : v < size G -> x v = x' v + Nat.b2n (A v).
Proof. apply (remaining_next G m s rules). Qed.

Lemma remaining_falls v : v < size G -> x' v <= x v.
Proof. intros H. rewrite (next_v v H). lia. Qed.

Lemma weight_next k : weight G x k = weight G x' k + count (size G) (fun v => k v && A v).
Proof.
  unfold weight, count. rewrite <- sum_plus. apply sum_ext. intros v Hv.
  rewrite (next_v v Hv). destruct (k v); simpl; auto.
Qed.

Lemma left_over_next j f :
  left_over G x j f = left_over G x' j f + count (size G) (fun v => negb (f v <=? j) && A v).
Proof.
  unfold left_over, count. rewrite <- sum_plus. apply sum_ext. intros v Hv.
  rewrite (next_v v Hv). destruct (f v <=? j); simpl; auto.
Qed.

(** The job's cores execute chains of the family, or what is left over. *)
Lemma busy_split j f :
  busy G s t = count (size G) (fun v => (f v <=? j) && A v)
             + count (size G) (fun v => negb (f v <=? j) && A v).
Proof.
  unfold busy, count. rewrite <- sum_plus. apply sum_ext. intros v Hv.
  destruct (f v <=? j), (A v); reflexivity.
Qed.

(** ** If the length does not fall, a longest chain waits as a whole *)

(** A chain of unfinished vertices, as long as any, of which none executes. *)
Definition waiting_chain (k : nat -> bool) : Prop :=
  longest G x k /\
  (forall v, v < size G -> k v = true -> 0 < x v) /\
  (forall v, v < size G -> k v = true -> A v = false) /\
  exists v, v < size G /\ k v = true.

Lemma unfinished_of_positive v : 0 < x v -> ~ finished s t v.
Proof. unfold remaining, finished. lia. Qed.

Lemma no_fall k k' :
  ~ complete G s t -> longest G x k -> longest G x' k' -> weight G x k <= weight G x' k' ->
  exists k0, waiting_chain k0.
Proof.
  intros U (Ck & Mk) (Ck' & _) H.
  pose proof (weight_next k') as W. pose proof (Mk k' Ck') as Q.
  assert (Z : count (size G) (fun v => k' v && A v) = 0) by lia.
  set (k0 := fun v => k' v && (0 <? x v)).
  assert (C0 : chain G k0) by (apply chain_part; auto).
  assert (W0 : weight G x k0 = weight G x k').
  { apply sum_ext. intros v Hv. unfold k0. destruct (k' v); simpl; auto.
    destruct (Nat.ltb_spec 0 (x v)); lia. }
  assert (L0 : longest G x k0).
  { split; auto. intros k2 C2. specialize (Mk k2 C2). lia. }
  exists k0. split; [auto|]. split; [|split].
  - intros v Hv K. unfold k0 in K. apply andb_true_iff in K. destruct K as (_ & K).
    apply Nat.ltb_lt in K. auto.
  - intros v Hv K. unfold k0 in K. apply andb_true_iff in K. destruct K as (K & _).
    destruct (A v) eqn:E; auto.
    pose proof (sum_term (size G) (fun v => Nat.b2n (k' v && A v)) v Hv) as T.
    cbv beta in T. rewrite K, E in T. simpl in T. unfold count in Z. lia.
  - destruct (some_or_none (size G) k0) as [E|N]; auto. exfalso.
    destruct (complete_or_not G s t) as [C|(v & Hv & F)]; [auto|].
    destruct L0 as (_ & M). specialize (M _ (chain_single G v)).
    assert (weight G x k0 = 0).
    { apply sum_zero. intros u Hu. rewrite (N u Hu). auto. }
    pose proof (sum_term (size G) (fun u => if u =? v then x u else 0) v Hv) as T.
    cbv beta in T. rewrite Nat.eqb_refl in T.
    pose proof (remaining_positive s t v F).
    unfold weight in M at 1. lia.
Qed.

(** ** Then a ready vertex waits, and every core is busy *)

Lemma first_one_waits k : waiting_chain k -> somebody_waits G s t = true.
Proof.
  intros ((C & M) & Pos & Idle & E).
  destruct (least (size G) k E) as (a & Ha & Ka & Least).
  apply somebody_waits_true. exists a. split.
  - split; [auto|]. split; [apply unfinished_of_positive; auto|].
    intros u Eu. destruct (finished_bool s t u) eqn:F; [apply finished_bool_true; auto|exfalso].
    apply finished_bool_false in F.
    pose proof (precedes_up _ _ _ Eu) as Up.
    (* u and the chain would be a heavier chain *)
    set (k2 := fun v => (v =? u) || k v).
    assert (C2 : chain G k2).
    { intros p q Hpq Hq Kp Kq. unfold k2 in Kp, Kq.
      apply orb_true_iff in Kp, Kq. rewrite Nat.eqb_eq in Kp, Kq.
      destruct Kp as [->|Kp], Kq as [->|Kq]; try lia.
      - destruct (Nat.eq_dec a q); [subst; auto|].
        apply precedes_trans with a; [auto|].
        apply C; auto. destruct (le_lt_dec q a); [|auto].
        rewrite (Least q) in Kq; [discriminate|lia].
      - rewrite (Least p) in Kp; [discriminate|lia].
      - apply C; auto. }
    specialize (M k2 C2).
    assert (weight G x k + x u <= weight G x k2).
    { assert (D : weight G x k2 = weight G x k + sum (size G) (fun v => if v =? u then x v else 0)).
      { unfold weight. rewrite <- sum_plus. apply sum_ext. intros v Hv. unfold k2.
        destruct (Nat.eqb_spec v u); simpl; [|lia].
        subst. rewrite (Least u); lia. }
      assert (Hu : u < size G) by lia.
      pose proof (sum_term (size G) (fun v => if v =? u then x v else 0) u Hu) as T.
      cbv beta in T. rewrite Nat.eqb_refl in T. lia. }
    pose proof (remaining_positive s t u F). lia.
  - apply Idle; auto.
Qed.

Lemma all_cores_busy : somebody_waits G s t = true -> m <= busy G s t + others s t.
Proof.
  rewrite somebody_waits_true. intros (v & Rd & E). apply (work_conserving G m s rules t v); auto.
Qed.

(** ** And some best family executes on at most j cores *)

(** At most one vertex of a chain executes, as two ready vertices are never ordered. *)
Lemma one_of_a_chain j f z :
  disjoint_chains G j f -> z <= j -> count (size G) (fun v => (f v =? z) && A v) <= 1.
Proof.
  intros D Hz. apply count_at_most_one. intros u v Hu Hv Pu Pv.
  apply andb_true_iff in Pu, Pv. rewrite Nat.eqb_eq in Pu, Pv.
  destruct Pu as (Fu & Au), Pv as (Fv & Av).
  apply (only_ready_run G m s rules) in Au; auto. apply (only_ready_run G m s rules) in Av; auto.
  destruct (lt_eq_lt_dec u v) as [[H|H]|H]; auto; exfalso.
  - apply (ready_not_ordered G s t u v Au Av). apply D; auto; lia.
  - apply (ready_not_ordered G s t v u Av Au). apply D; auto; lia.
Qed.

Lemma by_chains f n :
  count (size G) (fun v => (f v <? n) && A v)
  = sum n (fun z => count (size G) (fun v => (f v =? z) && A v)).
Proof.
  unfold count. rewrite <- sum_swap. apply sum_ext. intros v Hv.
  induction n; simpl; auto. rewrite <- IHn.
  destruct (A v); rewrite ?andb_false_r, ?andb_true_r; simpl; auto.
  destruct (Nat.eqb_spec (f v) n), (Nat.ltb_spec (f v) (S n)), (Nat.ltb_spec (f v) n); simpl; lia.
Qed.

(** A job executes on no more cores than its graph is wide: than there are chains that cover it. *)
Lemma busy_by_chains n f : chain_cover G n f ->
  busy G s t = sum n (fun z => count (size G) (fun v => (f v =? z) && A v)).
Proof.
  intros (Cover & _). rewrite <- by_chains. apply sum_ext. intros v Hv.
  specialize (Cover v Hv). destruct (Nat.ltb_spec (f v) n); [auto|lia].
Qed.

Lemma one_of_a_part n f z :
  disjoint_parts G n f -> z < n -> count (size G) (fun v => (f v =? z) && A v) <= 1.
Proof.
  intros D Hz. apply (one_of_a_chain (n - 1)); [|lia].
  intros u v H Hv E L. apply D; auto. lia.
Qed.

Lemma one_of_a_cover n f z :
  chain_cover G n f -> z < n -> count (size G) (fun v => (f v =? z) && A v) <= 1.
Proof. intros (_ & C) Hz. apply (one_of_a_part n); auto. intros u v H Hv E _. apply C; auto. Qed.

Lemma busy_at_most_width n f : chain_cover G n f -> busy G s t <= n.
Proof.
  intros C. rewrite (busy_by_chains n f C).
  apply Nat.le_trans with (sum n (fun _ => 1)); [|rewrite sum_const; lia].
  apply sum_le. intros z Hz. apply (one_of_a_cover n); auto.
Qed.

(** A family with a chain of which nothing executes executes on j cores at most. *)
Lemma at_most_j_cores j f y :
  disjoint_chains G j f -> y <= j ->
  (forall v, v < size G -> f v = y -> A v = false) ->
  count (size G) (fun v => (f v <=? j) && A v) <= j.
Proof.
  intros D Hy Idle.
  change (count (size G) (fun v => (f v <? S j) && A v) <= j).
  rewrite by_chains.
  assert (None : count (size G) (fun v => (f v =? y) && A v) = 0).
  { apply sum_zero. intros v Hv. destruct (Nat.eqb_spec (f v) y); auto. rewrite Idle; auto. }
  assert (Bound : forall n, n <= S j ->
            sum n (fun z => count (size G) (fun v => (f v =? z) && A v))
            + (if y <? n then 1 else 0) <= n).
  { induction n; intros Hn; [simpl; auto|]. cbn [sum].
    specialize (IHn ltac:(lia)). pose proof (one_of_a_chain j f n D ltac:(lia)) as One.
    destruct (Nat.eq_dec y n) as [->|].
    - rewrite None. destruct (Nat.ltb_spec n n), (Nat.ltb_spec n (S n)); lia.
    - destruct (Nat.ltb_spec y n), (Nat.ltb_spec y (S n)); lia. }
  specialize (Bound (S j) (le_n _)). destruct (Nat.ltb_spec y (S j)); lia.
Qed.

(** While one of its vertices waits, a job executes on fewer cores than its graph is wide. *)
Lemma busy_below_width n f v : chain_cover G n f -> ready G s t v -> A v = false -> busy G s t < n.
Proof.
  intros (Cover & C) Rv Av. pose proof Rv as (Hv & _). destruct n as [|j]; [specialize (Cover v Hv); lia|].
  assert (B : busy G s t = count (size G) (fun u => (f u <=? j) && A u)).
  { apply sum_ext. intros u Hu. specialize (Cover u Hu). destruct (Nat.leb_spec (f u) j); [auto|lia]. }
  rewrite B. apply le_n_S, (at_most_j_cores j f (f v)).
  - intros u w H Hw E _. apply C; auto.
  - specialize (Cover v Hv). lia.
  - intros u Hu E. destruct (A u) eqn:Au; auto. exfalso.
    pose proof (only_ready_run G m s rules t u Hu Au) as Ru.
    destruct (lt_eq_lt_dec u v) as [[H|H]|H]; [|congruence|].
    + apply (ready_not_ordered G s t u v Ru Rv). apply C; auto.
    + apply (ready_not_ordered G s t v u Rv Ru). apply C; auto.
Qed.

(** The exchange: each family has one that leaves no more, and of which one chain does not execute. *)
Lemma exchange j f k :
  waiting_chain k -> disjoint_chains G j f ->
  exists f', disjoint_chains G j f' /\
    left_over G x j f' <= left_over G x j f /\
    count (size G) (fun v => (f' v <=? j) && A v) <= j.
Proof.
  intros ((C & M) & Pos & Idle & _) D.
  (* Only the unfinished vertices of the family matter. *)
  set (g := fun v => if 0 <? x v then f v else S j).
  assert (Dg : disjoint_chains G j g).
  { intros u v H Hv E L. unfold g in *.
    destruct (0 <? x u), (0 <? x v); try lia. apply D; auto. }
  assert (Lg : left_over G x j g = left_over G x j f).
  { apply sum_ext. intros v Hv. unfold g. destruct (Nat.ltb_spec 0 (x v)); auto.
    destruct (f v <=? j), (S j <=? j); lia. }
  assert (Ug : forall v, v < size G -> g v <= j -> 0 < x v).
  { intros v Hv H. unfold g in H. destruct (Nat.ltb_spec 0 (x v)); lia. }
  destruct (some_or_none (size G) (fun v => k v && (g v <=? j))) as [Meets|Apart].
  - (* The waiting chain shares vertices with the family: l is the first of them. *)
    apply least in Meets. destruct Meets as (l & Hl & Pl & Least).
    apply andb_true_iff in Pl. destruct Pl as (Kl & Fl). apply Nat.leb_le in Fl.
    set (y := g l).
    set (Q := fun v => k v && (v <? l)).
    set (P := fun v => (g v =? y) && (v <? l)).
    set (f' := fun v => if Q v then y else if P v then S j else g v).
    assert (Qout : forall v, Q v = true -> k v = true /\ v < l /\ j < g v).
    { intros v H. unfold Q in H. apply andb_true_iff in H. destruct H as (H1 & H2).
      apply Nat.ltb_lt in H2. specialize (Least v H2). rewrite H1 in Least. simpl in Least.
      apply Nat.leb_gt in Least. auto. }
    assert (Pin : forall v, P v = true <-> g v = y /\ v < l).
    { intros v. unfold P. rewrite andb_true_iff, Nat.eqb_eq, Nat.ltb_lt. tauto. }
    assert (D' : disjoint_chains G j f').
    { intros u v H Hv E L. unfold f' in E, L.
      destruct (Q u) eqn:Qu, (Q v) eqn:Qv.
      - apply Qout in Qu, Qv. apply C; intuition.
      - apply Qout in Qu. destruct (P v) eqn:Pv; [lia|].
        assert (l <= v).
        { destruct (le_lt_dec l v); auto. exfalso.
          assert (P v = true) by (apply Pin; auto). congruence. }
        assert (precedes G u l) by (apply C; intuition lia).
        destruct (Nat.eq_dec l v); [subst; auto|].
        apply precedes_trans with l; auto. apply Dg; auto; lia.
      - apply Qout in Qv. destruct (P u) eqn:Pu; [lia|].
        exfalso. assert (P u = true) by (apply Pin; intuition lia). congruence.
      - destruct (P u), (P v); try lia. apply Dg; auto. }
    exists f'. split; [auto|]. split.
    + (* P before l is no heavier than Q before l, for the chain is a longest one. *)
      set (k2 := fun v => P v || (k v && (l <=? v))).
      assert (C2 : chain G k2).
      { intros u v H Hv Ku Kv. unfold k2 in Ku, Kv.
        apply orb_true_iff in Ku, Kv. rewrite Pin, andb_true_iff, Nat.leb_le in Ku, Kv.
        destruct Ku as [(Gu & Lu)|(Ku & Lu)], Kv as [(Gv & Lv)|(Kv & Lv)]; try lia.
        - apply Dg; auto; unfold y in *; lia.
        - assert (precedes G u l) by (apply Dg; auto; unfold y in *; lia).
          destruct (Nat.eq_dec l v); [subst; auto|].
          apply precedes_trans with l; auto. apply C; auto. lia.
        - apply C; auto. }
      specialize (M k2 C2).
      assert (WP : weight G x k2 = weight G x P + weight G x (fun v => k v && (l <=? v))).
      { unfold weight. rewrite <- sum_plus. apply sum_ext. intros v Hv. unfold k2.
        destruct (P v) eqn:Pv; simpl; auto.
        apply Pin in Pv. destruct (Nat.leb_spec l v); [lia|]. rewrite andb_false_r. lia. }
      assert (WQ : weight G x k = weight G x Q + weight G x (fun v => k v && (l <=? v))).
      { unfold weight. rewrite <- sum_plus. apply sum_ext. intros v Hv. unfold Q.
        destruct (k v); simpl; auto.
        destruct (Nat.ltb_spec v l), (Nat.leb_spec l v); lia. }
      assert (W : left_over G x j f' + weight G x Q = left_over G x j g + weight G x P).
      { unfold left_over, weight. rewrite <- !sum_plus. apply sum_ext. intros v Hv. unfold f'.
        destruct (Q v) eqn:Qv.
        - apply Qout in Qv. destruct (P v) eqn:Pv.
          + apply Pin in Pv. unfold y in *. lia.
          + destruct (Nat.leb_spec y j), (Nat.leb_spec (g v) j); unfold y in *; lia.
        - destruct (P v) eqn:Pv.
          + apply Pin in Pv. destruct (Nat.leb_spec (S j) j), (Nat.leb_spec (g v) j);
              unfold y in *; lia.
          + lia. }
      lia.
    + (* Nothing of the new chain y executes. *)
      apply (at_most_j_cores j f' y); auto.
      intros v Hv E. unfold f' in E. destruct (Q v) eqn:Qv.
      * apply Qout in Qv. apply Idle; intuition.
      * destruct (P v) eqn:Pv; [unfold y in *; lia|].
        assert (l <= v).
        { destruct (le_lt_dec l v); auto. exfalso.
          assert (P v = true) by (apply Pin; auto). congruence. }
        destruct (Nat.eq_dec l v); [subst; auto|].
        destruct (A v) eqn:Av; auto. exfalso.
        apply (only_ready_run G m s rules) in Av; auto.
        assert (Lv : precedes G l v) by (apply Dg; auto; unfold y in *; lia).
        apply (ready_after_ancestors G s t l v Lv) in Av.
        specialize (Ug l Hl Fl). apply unfinished_of_positive in Ug. auto.
  - (* It shares none: it takes the place of chain 0. *)
    assert (Out : forall v, v < size G -> k v = true -> j < g v).
    { intros v Hv K. specialize (Apart v Hv). cbv beta in Apart. rewrite K in Apart.
      simpl in Apart. apply Nat.leb_gt in Apart. auto. }
    set (f' := fun v => if k v then 0 else if g v =? 0 then S j else g v).
    assert (D' : disjoint_chains G j f').
    { intros u v H Hv E L. unfold f' in E, L.
      destruct (k u) eqn:Ku, (k v) eqn:Kv.
      - apply C; auto.
      - destruct (Nat.eqb_spec (g v) 0); lia.
      - destruct (Nat.eqb_spec (g u) 0); lia.
      - destruct (Nat.eqb_spec (g u) 0), (Nat.eqb_spec (g v) 0); try lia. apply Dg; auto. }
    exists f'. split; [auto|]. split.
    + set (C0 := fun v => g v =? 0).
      assert (CC : chain G C0).
      { intros u v H Hv Ku Kv. unfold C0 in *. apply Nat.eqb_eq in Ku, Kv. apply Dg; auto; lia. }
      specialize (M C0 CC).
      assert (W : left_over G x j f' + weight G x k = left_over G x j g + weight G x C0).
      { unfold left_over, weight. rewrite <- !sum_plus. apply sum_ext. intros v Hv. unfold f', C0.
        destruct (k v) eqn:Kv.
        - specialize (Out v Hv Kv).
          destruct (Nat.leb_spec 0 j), (Nat.leb_spec (g v) j), (Nat.eqb_spec (g v) 0); lia.
        - destruct (Nat.eqb_spec (g v) 0) as [->|].
          + destruct (Nat.leb_spec (S j) j), (Nat.leb_spec 0 j); lia.
          + lia. }
      lia.
    + apply (at_most_j_cores j f' 0); auto; [lia|].
      intros v Hv E. unfold f' in E. destruct (k v) eqn:Kv; auto.
      destruct (Nat.eqb_spec (g v) 0); lia.
Qed.

(** ** Both together *)

(** What is left over never rises. *)
Lemma left_over_falls j f f' :
  best G x j f -> best G x' j f' -> left_over G x' j f' <= left_over G x j f.
Proof.
  intros (D & _) (_ & M'). specialize (M' f D).
  pose proof (left_over_monotone G x' x j f remaining_falls). lia.
Qed.

(** If the length does not fall, then some ready vertex waits, so all cores are busy; and what is left over
    falls by the number of the job's cores less j. *)
Lemma waiting_tick j k k' f f' :
  ~ complete G s t ->
  longest G x k -> longest G x' k' -> weight G x k <= weight G x' k' ->
  best G x j f -> best G x' j f' ->
  somebody_waits G s t = true /\
  left_over G x' j f' + busy G s t <= left_over G x j f + j.
Proof.
  intros U Lk Lk' H (D & _) (_ & M').
  destruct (no_fall k k' U Lk Lk' H) as (k0 & W).
  split; [apply (first_one_waits k0 W)|].
  destruct (exchange j f k0 W D) as (f2 & D2 & L2 & J).
  specialize (M' f2 D2).
  pose proof (left_over_next j f2). pose proof (busy_split j f2). lia.
Qed.

End one_tick.

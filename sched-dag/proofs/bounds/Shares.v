(** * Segments that share a WCET

    Of a subtask that waits, the WCET may be known of all segments together only.  Its first segment is then the
    [head] of each: as far as sums go along paths and over chains, all of the subtask's execution is there.  [x]: what
    vertices execute; [y]: what those of one head do at most. *)

Require Import Arith Lia Bool List.
From Bounds Require Import Sums Model Chains.

(** A vertex that shares comes after a wait, this one after a vertex of the same head, and after nothing else. *)
Definition heads_first (G : dag) (head : nat -> nat) : Prop := forall v, v < size G -> head v = v \/
  exists w u, edge G u w = true /\ edge G w v = true /\ head u = head v /\
    (forall z, edge G z v = true -> z = w) /\ (forall z, edge G z w = true -> z = u).

Lemma path_length_monotone c c' l : (forall v, c v <= c' v) -> path_length c l <= path_length c' l.
Proof. intros H. unfold path_length. induction l as [|v l IH]; simpl; [lia|]. specialize (H v). lia. Qed.

Lemma no_path_longer_ext G c c' len : (forall v, c v = c' v) -> no_path_longer G c len -> no_path_longer G c' len.
Proof.
  intros E H l P. apply Nat.le_trans with (2 := H l P). apply path_length_monotone. intros v. rewrite E. lia.
Qed.

(** The vertices of a path are a chain. *)
Lemma path_is_chain G l : path G l -> exists k, chain G k /\ (forall c, path_length c l = weight G c k) /\
  forall v, k v = true -> match l with nil => False | last :: _ => v = last \/ precedes G v last end.
Proof.
  induction l as [|v l IH]; intros P.
  - exists (fun _ => false). split; [intros u v _ _ H; discriminate|]. split; [|discriminate].
    intros c. unfold weight. rewrite sum_zero; auto.
  - destruct P as (Hv & E & P). destruct (IH P) as (k & C & W & B).
    assert (Bv : forall u, k u = true -> precedes G u v).
    { intros u Ku. specialize (B u Ku). destruct l as [|w l]; [tauto|].
      destruct B as [->|B]; [apply precedes_edge, E|apply precedes_further with w; auto]. }
    assert (Kv : k v = false).
    { destruct (k v) eqn:Kv; auto. specialize (Bv v Kv). apply precedes_up in Bv. lia. }
    exists (fun u => (u =? v) || k u). split; [|split].
    + intros a b Hab Hb Ka Kb. destruct (Nat.eqb_spec a v) as [->|Na], (Nat.eqb_spec b v) as [->|Nb]; try lia.
      * specialize (Bv b Kb). apply precedes_up in Bv. lia.
      * apply Bv, Ka.
      * apply C; auto.
    + intros c. unfold path_length in *. simpl. rewrite (W c).
      replace (c v) with (sum (size G) (fun u => if u =? v then c u else 0)).
      * unfold weight. rewrite <- sum_plus. apply sum_ext. intros u _.
        destruct (Nat.eqb_spec u v) as [->|]; [rewrite Kv|]; simpl; lia.
      * rewrite (sum_only _ _ v Hv); [rewrite Nat.eqb_refl; auto|].
        intros u _ Ne. destruct (Nat.eqb_spec u v); [lia|auto].
    + intros u Ku. destruct (Nat.eqb_spec u v); [auto|]. right. apply Bv, Ku.
Qed.

Section shares.
Variables (G : dag) (head : nat -> nat).
Hypothesis first : heads_first G head.

Lemma head_before v : v < size G -> head v = v \/ precedes G (head v) v.
Proof.
  induction v as [v IH] using (well_founded_induction lt_wf). intros Hv.
  destruct (first v Hv) as [E|(w & u & Eu & Ew & Eh & _)]; [auto|right]. rewrite <- Eh.
  pose proof (edges_lead_up _ _ _ Eu). pose proof (edges_lead_up _ _ _ Ew).
  assert (P : precedes G u v) by (apply precedes_further with w; [apply precedes_edge|]; auto).
  destruct (IH u ltac:(lia) ltac:(lia)) as [->|Q]; [exact P|apply precedes_trans with u; auto].
Qed.

Lemma heads_closed (p : nat -> bool) : (forall u v, edge G u v = true -> p v = true -> p u = true) ->
  forall v, v < size G -> p v = true -> p (head v) = true.
Proof.
  intros Closed v Hv Pv. assert (Up : forall u v, precedes G u v -> p v = true -> p u = true).
  { induction 1 as [w E|w z P IH E]; intros Pw; [apply (Closed u w E Pw)|apply IH, (Closed w z E Pw)]. }
  destruct (head_before v Hv) as [->|P]; [exact Pv|apply (Up _ _ P Pv)].
Qed.

Lemma head_in v : v < size G -> head v < size G.
Proof. intros Hv. destruct (head_before v Hv) as [->|P]; [auto|]. apply precedes_up in P. lia. Qed.

(** What is so of each vertex and the one before it of the same head is so of each and its head. *)
Lemma of_head (A : Type) (g : nat -> A) :
  (forall v, v < size G -> head v = v \/ exists u, u < v /\ head u = head v /\ g u = g v) ->
  forall v, v < size G -> g (head v) = g v.
Proof.
  intros H v. induction v as [v IH] using (well_founded_induction lt_wf). intros Hv.
  destruct (H v Hv) as [->|(u & Hu & Eh & Eg)]; [auto|]. rewrite <- Eh, <- Eg. apply IH; lia.
Qed.

Lemma head_of_head v : v < size G -> head (head v) = head v.
Proof.
  intros Hv. apply (of_head nat head); auto. intros u Hu. destruct (first u Hu) as [E|(w & z & Ez & Ew & Eh & _)]; auto.
  right. exists z. pose proof (edges_lead_up _ _ _ Ez). pose proof (edges_lead_up _ _ _ Ew). repeat split; auto. lia.
Qed.

Lemma past_head u v : v < size G -> precedes G u v ->
  u = head v \/ precedes G u (head v) \/ precedes G (head v) u.
Proof.
  revert u. induction v as [v IH] using (well_founded_induction lt_wf). intros u Hv P.
  destruct (first v Hv) as [->|(w & z & Ez & Ew & Eh & Only & Only')]; [auto|]. rewrite <- Eh.
  pose proof (edges_lead_up _ _ _ Ez). pose proof (edges_lead_up _ _ _ Ew).
  assert (Hz : precedes G u z \/ u = z \/ u = w).
  { inversion P as [? E|w' ? P' E]; subst; [right; right; apply Only, E|].
    rewrite (Only w' E) in P'. inversion P' as [? E'|z' ? Q E']; subst; [right; left; apply Only', E'|left].
    rewrite <- (Only' z' E'). exact Q. }
  pose proof (head_before z ltac:(lia)) as Hh. destruct Hz as [Q|[->| ->]].
  - apply IH; auto; lia.
  - destruct Hh as [->|Q]; auto.
  - right. right. destruct Hh as [->|Q]; [apply precedes_edge, Ez|apply precedes_further with z; auto].
Qed.

Definition with_heads (k : nat -> bool) (v : nat) : bool :=
  k v || existsb (fun u => k u && (head u =? v)) (seq 0 (size G)).

Lemma with_heads_true k v : v < size G -> with_heads k v = true ->
  exists u, u < size G /\ k u = true /\ (v = u \/ v = head u).
Proof.
  unfold with_heads. rewrite orb_true_iff, existsb_exists. intros Hv [K|(u & I & K)]; [exists v; auto|].
  rewrite andb_true_iff, Nat.eqb_eq in K. apply in_seq in I. exists u. split; [lia|]. split; [tauto|]. right. symmetry. tauto.
Qed.

Lemma with_heads_chain k : chain G k -> chain G (with_heads k).
Proof.
  intros C a b Hab Hb Ka Kb.
  assert (Cmp : forall a b u v, u < size G -> v < size G -> (u = v \/ precedes G u v) ->
    (a = u \/ a = head u) -> (b = v \/ b = head v) -> a = b \/ precedes G a b \/ precedes G b a).
  { clear - first. intros a b u v Hu Hv P Ea Eb.
    assert (Pa : a = v \/ precedes G a v).
    { assert (Q : a = u \/ precedes G a u) by (destruct Ea as [->| ->]; [auto|apply head_before; auto]).
      destruct P as [->|P]; [exact Q|right]. destruct Q as [->|Q]; [exact P|apply precedes_trans with u; auto]. }
    destruct Eb as [->| ->]; [tauto|]. destruct Pa as [->|Pa]; [|apply past_head; auto].
    destruct (head_before v Hv) as [->|Q]; auto. }
  destruct (with_heads_true k a ltac:(lia) Ka) as (u & Hu & Ku & Eu).
  destruct (with_heads_true k b Hb Kb) as (v & Hv & Kv & Ev).
  assert (H : a = b \/ precedes G a b \/ precedes G b a).
  { destruct (lt_eq_lt_dec u v) as [[L|L]|L].
    - apply (Cmp a b u v); auto.
    - apply (Cmp a b u v); auto.
    - destruct (Cmp b a v u Hv Hu) as [E|[E|E]]; auto. }
  destruct H as [H|[H|H]]; [lia|exact H|]. apply precedes_up in H. lia.
Qed.

(** Sums of a part that has each head of its vertices. *)
Lemma sums_of_part (p : nat -> bool) x y : (forall v, v < size G -> p v = true -> p (head v) = true) ->
  (forall b, b < size G -> sum (size G) (fun v => if head v =? b then x v else 0) <= y b) ->
  forall b, b < size G -> sum (size G) (fun v => if head v =? b then if p v then x v else 0 else 0)
                          <= if p b then y b else 0.
Proof.
  intros Closed Sums b Hb. destruct (p b) eqn:Pb.
  - apply Nat.le_trans with (2 := Sums b Hb). apply sum_le. intros v _. destruct (head v =? b), (p v); lia.
  - rewrite sum_zero; [lia|]. intros v Hv. destruct (Nat.eqb_spec (head v) b) as [<-|]; auto.
    destruct (p v) eqn:Pv; auto. rewrite (Closed v Hv Pv) in Pb. discriminate.
Qed.

Variables (x y : nat -> nat).
Hypothesis sums : forall b, b < size G -> sum (size G) (fun v => if head v =? b then x v else 0) <= y b.

Lemma shared_weight k : (forall v, v < size G -> k v = true -> k (head v) = true) -> weight G x k <= weight G y k.
Proof.
  intros Closed.
  apply Nat.le_trans with (sum (size G) (fun b => if k b then sum (size G) (fun v => if head v =? b then x v else 0) else 0)).
  - apply Nat.le_trans with (sum (size G) (fun b => sum (size G) (fun v => if k b && (head v =? b) then x v else 0))).
    + rewrite sum_swap. apply sum_le. intros v Hv. destruct (k v) eqn:Kv; [|lia].
      pose proof (sum_term (size G) (fun b => if k b && (head v =? b) then x v else 0) (head v) (head_in v Hv)) as T.
      cbv beta in T. rewrite (Closed v Hv Kv), Nat.eqb_refl in T. exact T.
    + apply sum_le. intros b _. destruct (k b); simpl; [lia|]. rewrite sum_zero; auto.
  - apply sum_le. intros b Hb. destruct (k b); auto.
Qed.

Lemma shared_paths e len : no_path_longer G (fun v => y v + e v) len -> no_path_longer G (fun v => x v + e v) len.
Proof.
  intros N l P. destruct (path_is_chain G l P) as (k & C & W & _). rewrite W.
  pose proof (chain_at_most_length G _ len _ N (with_heads_chain k C)) as B.
  apply Nat.le_trans with (2 := B). unfold weight.
  apply Nat.le_trans with (weight G x (with_heads k) + weight G e (with_heads k)).
  - unfold weight. rewrite <- sum_plus. apply sum_le. intros v _. unfold with_heads. destruct (k v); simpl; lia.
  - apply Nat.le_trans with (weight G y (with_heads k) + weight G e (with_heads k)).
    + apply Nat.add_le_mono_r, shared_weight. intros v Hv Kv.
      destruct (with_heads_true k v Hv Kv) as (u & Hu & Ku & E). unfold with_heads. apply orb_true_iff. right.
      apply existsb_exists. exists u. rewrite in_seq, Ku. split; [lia|]. apply Nat.eqb_eq.
      destruct E as [->| ->]; [reflexivity|]. rewrite head_of_head; auto.
    + unfold weight. rewrite <- sum_plus. apply sum_le. intros v _. destruct (with_heads k v); lia.
Qed.

Lemma shared_length len : no_path_longer G y len -> no_path_longer G x len.
Proof.
  intros N l P. apply Nat.le_trans with (path_length (fun v => x v + 0) l).
  - apply path_length_monotone. intros v. lia.
  - apply (shared_paths (fun _ => 0)); auto. intros l' P'. apply Nat.le_trans with (2 := N l' P').
    apply path_length_monotone. intros v. lia.
Qed.

Lemma shared_left_over j f : (forall v, v < size G -> f (head v) = f v) -> left_over G x j f <= left_over G y j f.
Proof.
  intros F.
  assert (E : forall z, left_over G z j f = weight G z (fun v => negb (f v <=? j)))
    by (intros z; apply sum_ext; intros v _; destruct (f v <=? j); reflexivity).
  rewrite !E. apply shared_weight. intros v Hv. rewrite F; auto.
Qed.

End shares.

(** * Conditions C1 to C4 are enough

    [right] of Sustainable.v is what the theorem needs. Here are simpler conditions on an endless table (all laps), with
    WCETs of 1 or more, and the proof that they imply [right]. C1: an entry starts no earlier than its release. C2: it
    starts when what it waits for has finished, with a pause, if there is one. C3: what starts before another finishes
    has a greater depth. C4: an entry and its family take just the time from its start to its finish. *)

From Coq Require Import ZArith List Bool Lia.
From Table Require Import Model Sustainable.
Import ListNotations.
Open Scope Z_scope.

(** Not needed: a deadline; that of [d] open entries each depth 0..d-1 occurs once, that they finish no earlier than what
    is nested in them, and that none keeps its core. *)
Record conditions (tb : table) : Prop := {
  positive : forall p, (fst p < cores tb)%nat -> 1 <= wcet tb p;
  from_0 : forall k, (k < cores tb)%nat -> 0 <= start tb (k, O);
  by_start : forall k i, (k < cores tb)%nat -> start tb (k, i) <= start tb (k, S i);
  c1 : forall p, (fst p < cores tb)%nat -> release tb p <= start tb p;
  c2 : forall p y, (fst y < cores tb)%nat -> before tb p y ->
    (fst p < cores tb)%nat /\ 0 <= wait tb p y /\ finish tb p + wait tb p y <= start tb y;
  (* an earlier entry that is unfinished when [y] starts has a smaller depth *)
  c3 : forall k x y, (k < cores tb)%nat -> (x < y)%nat -> start tb (k, y) < finish tb (k, x) ->
    depth tb (k, x) < depth tb (k, y);
  (* [x] and the [n] entries that directly follow with a larger depth: its family *)
  c4 : forall k x, (k < cores tb)%nat -> exists n,
    (forall j, (x < j < S x + n)%nat -> depth tb (k, x) < depth tb (k, j)) /\
    depth tb (k, (S x + n)%nat) <= depth tb (k, x) /\
    finish tb (k, x) - start tb (k, x) = wcet tb (k, x) + work tb k (S x) n
}.

Theorem conditions_suffice : forall tb, conditions tb -> right tb.
Proof.
  intros tb C. constructor; [constructor|apply (from_0 tb C)|apply (c1 tb C)].
  - intros p Hp. pose proof (positive tb C p Hp). lia.
  - apply (by_start tb C).
  - intros k x Hk. destruct (c4 tb C k x Hk) as (n & Hin & Hout & Hf). exists n. split; [|lia].
    split; [auto|]. destruct (Z_lt_ge_dec (start tb (k, (S x + n)%nat)) (finish tb (k, x))) as [Hlt|]; [|lia].
    pose proof (c3 tb C k x (S x + n)%nat Hk ltac:(lia) Hlt). lia.
  - intros p y Hy Hb. destruct (c2 tb C p y Hy Hb) as (Hp & Hw & Hf). repeat split; auto.
    destruct p as [k x]; simpl in Hp. destruct (c4 tb C k x Hp) as (n & _ & _ & E).
    pose proof (positive tb C (k, x) Hp).
    assert (W : forall m i, 0 <= work tb k i m).
    { induction m; simpl; intros i; [lia|]. pose proof (positive tb C (k, i) Hp). specialize (IHm (S i)). lia. }
    specialize (W n (S x)). lia.
Qed.

(** **Theorem T by these conditions.** *)
Corollary theorem_t : forall tb env late s, conditions tb -> punctual tb env late -> 0 <= late ->
  run tb env initial s -> forall p, (fst p < cores tb)%nat ->
  (~ started s p -> now s <= start tb p + late + lost s) /\
  (~ finished s p -> now s <= finish tb p + late + lost s).
Proof. intros. apply sustainable with env; auto. apply conditions_suffice; auto. Qed.



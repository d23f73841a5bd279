(** * A commit, or a table, from a list of numbers

    What `./scripts/check-witness --proven` writes is read here, so that neither OCaml nor Coq needs a reader of its
    own.  Not proven: the theorems are about the commit or table that is read, and a test alters every number.

    A commit: 0, cores, order (0: static, 1: EDF, 2: any), overhead, DAGs; of each DAG: least time between releases, deadline, least
    deadline of a sink, 1 if a bound is claimed, bound, loss, chains in the cover and in the division, j, subtasks; of
    each subtask: priority, 1 if it keeps its core, its chains in cover, division and bound, its predecessors and its
    times, of both first how many there are.

    A table: 1, how laps begin (0: on the grid, 1: at releases, 2: at releases, with losses), lap, least time between laps,
    what a lap may lose, DAGs; of each DAG: period, offset, subtasks; of each subtask: WCET, bound, loss in it, 1 if it
    keeps its core, how many predecessors, and these.  Then lists; of each list how many entries; of each entry: DAG,
    job as a difference of two numbers, subtask, start, finish, depth. *)

Require Import Bool List NArith ZArith.
From Bounds Require Import Commit.
From Table Require Checker Sporadic Losses.
Import ListNotations.

Definition parser (A : Type) : Type := list N -> option (A * list N).

Definition give {A} (a : A) : parser A := fun l => Some (a, l).
Definition bind {A B} (p : parser A) (f : A -> parser B) : parser B :=
  fun l => match p l with Some (a, l') => f a l' | None => None end.
Notation "x <- p ;; q" := (bind p (fun x => q)) (at level 61, p at next level, right associativity).

Definition one : parser N := fun l => match l with n :: l => Some (n, l) | [] => None end.

(** What is counted is small. *)
Definition small : parser nat := fun l =>
  match l with n :: l => if (n <=? 65536)%N then Some (N.to_nat n, l) else None | [] => None end.

Definition flag : parser bool := fun l =>
  match l with 0%N :: l => Some (false, l) | 1%N :: l => Some (true, l) | _ => None end.

Fixpoint many {A} (n : nat) (p : parser A) : parser (list A) :=
  match n with 0 => give [] | S n => a <- p;; rest <- many n p;; give (a :: rest) end.
Definition listed {A} (p : parser A) : parser (list A) := n <- small;; many n p.

Definition a_subtask : parser subtask :=
  p <- one;; k <- flag;; a <- small;; b <- small;; x <- small;; u <- listed small;; t <- listed one;;
  give {| priority := p; keeps_its_core := k; times := t; predecessors := u; in_cover := a; in_part := b; in_chain := x |}.

Definition a_dag : parser dag_statement :=
  t <- one;; d <- one;; e <- one;; h <- flag;; r <- one;; x <- one;; a <- small;; b <- small;; j <- small;;
  vs <- listed a_subtask;;
  give {| subtasks := vs; least_gap := t; due := d; least_due := e; has_claim := h; claimed_bound := r;
          claimed_loss := x; cover_chains := a; part_chains := b; beside := j |}.

Definition an_order : parser order := fun l =>
  match l with 0%N :: l => Some (Static, l) | 1%N :: l => Some (Edf, l) | 2%N :: l => Some (Any, l) | _ => None end.

Definition a_commit : parser commit :=
  m <- small;; o <- an_order;; c <- one;; ds <- listed a_dag;;
  give {| machine_cores := m; ranking := o; overhead := c; dags := ds |}.

Definition whole : parser Z := n <- one;; give (Z.of_N n).

Definition a_table : parser (N * Z * Z * Checker.witness) :=
  k <- one;; lap <- whole;; g <- whole;; x <- whole;;
  ds <- listed (t <- whole;; o <- whole;;
    vs <- listed (c <- whole;; r <- whole;; x <- whole;; a <- flag;; u <- listed small;;
      give (Checker.Subtask c (r - x) a (map (fun u => (u, 0%Z)) u)));;
    give (Checker.Dag t o vs));;
  ls <- listed (listed (d <- small;; j <- whole;; i <- whole;; v <- small;; b <- whole;; f <- whole;; n <- whole;;
    give (Checker.Entry d (j - i)%Z v b f n)));;
  give (k, g, x, Checker.Witness lap ds ls).

(** A WCET of 0 is an unknown one, here too. *)
Definition known_wcets (w : Checker.witness) : bool :=
  forallb (fun d => forallb (fun v => 0 <? Checker.s_wcet v)%Z (Checker.d_subtasks d)) (Checker.w_dags w).

(** For each DAG of a commit whether its bound is proven, or for all of a table together ([judge_sound],
    [accepted_bounds_hold], [sporadic_bounds_hold], [losing_bounds_hold]); nothing if the list is neither, or goes on. *)
Definition judge_numbers (l : list N) : option (list bool) :=
  match l with
  | 0%N :: l => match a_commit l with Some (c, []) => Some (judge c) | _ => None end
  | 1%N :: l =>
      match a_table l with
      | Some ((k, g, x, w), []) =>
          let ok := match k with
            | 0%N => Checker.check w
            | 1%N => Sporadic.check_sporadic w
            | 2%N => Losses.check_losing w g x
            | _ => false
            end in
          Some (map (fun _ => known_wcets w && ok) (Checker.w_dags w))
      | _ => None
      end
  | _ => None
  end.

(** * A commit of one core from a list of numbers, and all that the program judges

    2, then a commit as in Reader.v, whose claims are of no matter here; what takes the core: how many, and of each what is
    carried in, the period, and the time; then of each DAG: the deadlines of its subtasks (0: none of its own) and their
    numbers, of both first how many there are; 1 if a bound is claimed, the bound, stretch and level; how many points,
    and of each the distance, how many finishes, and these; how many sinks have bounds of their own, and of each the
    vertex, bound, stretch, and points.

    3, then a commit likewise, and of each DAG how many sinks have bounds of their own, and of each the subtask, the
    bound, and the loss. *)

Require Import Bool List NArith.
From Bounds Require Import Commit SinkCommit OneCoreCheck OneCoreCommit.
From Judge Require Import Reader.
Import ListNotations.

Definition a_burst : parser burst :=
  a <- one;; p <- one;; t <- one;; give {| carried := a; apart := p; taken := t |}.

Definition points_listed : parser (list (N * list N)) := listed (a <- one;; fs <- listed one;; give (a, fs)).

Definition a_sink : parser sink_claim :=
  v <- small;; r <- one;; l <- one;; ps <- points_listed;;
  give {| sink := v; sink_bound := r; sink_stretch := l; sink_points := ps |}.

Definition a_core_statement : parser core_statement :=
  ds <- listed one;; ns <- listed small;; h <- flag;; r <- one;; l <- one;; d <- one;;
  ps <- points_listed;; ss <- listed a_sink;;
  give {| own_dues := ds; own_numbers := ns; core_bound := if h : bool then Some r else None;
          core_stretch := l; core_level := d; core_points := ps; core_sinks := ss |}.

(** A burst that never ends, or comes at no distance, is none that the theorem means. *)
Definition judge_core_numbers (l : list N) : option (list bool) :=
  match a_commit l with
  | Some (c, l) =>
      match (bs <- listed a_burst;; more <- many (length (dags c)) a_core_statement;; give (bs, more)) l with
      | Some ((bs, more), []) =>
          if forallb (fun b => (0 <? apart b)%N) bs then Some (judge_core c more bs)
          else Some (map (fun _ => false) (dags c))
      | _ => None
      end
  | None => None
  end.

Definition an_own_claim : parser own_claim :=
  v <- small;; r <- one;; x <- one;; give {| subtask_number := v; own_bound := r; own_loss := x |}.

Definition judge_sink_numbers (l : list N) : option (list bool) :=
  match a_commit l with
  | Some (c, l) =>
      match many (length (dags c)) (listed an_own_claim) l with
      | Some (own, []) => Some (judge_sinks c own)
      | _ => None
      end
  | None => None
  end.

(** [judge_sound], [judge_sinks_sound], [judge_core_sound], [accepted_bounds_hold], [sporadic_bounds_hold],
    [losing_bounds_hold]. *)
Definition judge_all (l : list N) : option (list bool) :=
  match l with 2%N :: l => judge_core_numbers l | 3%N :: l => judge_sink_numbers l | _ => judge_numbers l end.

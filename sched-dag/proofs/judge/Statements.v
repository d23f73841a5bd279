(** How the program reads its numbers; statements.txt has the answers. *)
Require Import List NArith.
From Judge Require Import Reader CoreReader.
Set Printing Width 110. Set Printing Depth 1000.
Print parser. Print give. Print bind. Print one. Print small. Print flag. Print many. Print listed. Print a_subtask.
Print a_dag. Print an_order. Print a_commit. Print whole. Print a_table. Print known_wcets. Print judge_numbers.
Print a_burst. Print points_listed. Print a_sink. Print a_core_statement. Print judge_core_numbers.
Print an_own_claim. Print judge_sink_numbers. Print judge_all.
Print Assumptions judge_all.

(** * The judge as a program in OCaml, without any number type of OCaml's *)

From Coq Require Extraction.
From Coq Require Import ExtrOcamlBasic NArith.
From Judge Require Import CoreReader.

Extraction "judge.ml" judge_all N.add N.mul.

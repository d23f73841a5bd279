(* Of each line of numbers, which Reader.v says, a line: by DAG 1 if its bounds are proven, else 0; or `unreadable`. *)
open Judge

let one = Npos XH
let rec digit c =
  if c = '0' then N0 else if c < '0' || c > '9' then raise Exit
  else N.add one (digit (Char.chr (Char.code c - 1)))
let ten = N.add one (digit '9')

let number word =
  let value = ref N0 in
  String.iter (fun c -> value := N.add (N.mul ten !value) (digit c)) word;
  !value

let () =
  try
    while true do
      let words = String.split_on_char ' ' (input_line stdin) in
      match judge_all (List.map number words) with
      | Some proven -> print_endline (String.concat " " (List.map (fun yes -> if yes then "1" else "0") proven))
      | None | exception Exit -> print_endline "unreadable"
    done
  with End_of_file -> ()

# Of definitions (*.v) and of Coq's answers (the last file): names of definitions that the answers
# have, but do not print.  A name that an answer binds is none of ours there.
function bind(names,   words, i) {
    split(names, words, /[^A-Za-z0-9_']+/)
    for (i in words) bound[words[i]]
}

# Takes up an answer whose lines are joined in `text`.
function take(   rest, word) {
    split("", bound)
    for (rest = text; match(rest, /[A-Za-z_][A-Za-z0-9_ ']* :[^=]|let [A-Za-z0-9_']+| \| [^|=:]* =>/); \
         rest = substr(rest, RSTART + RLENGTH))
        bind(substr(rest, RSTART, RLENGTH))
    # Fields are printed with their record.
    for (rest = record ? text : ""; match(rest, /[{;] +[A-Za-z0-9_']+ :/); rest = substr(rest, RSTART + RLENGTH)) {
        word = substr(rest, RSTART + 1, RLENGTH - 3)
        gsub(/ /, "", word)
        printed[word]
    }
    for (rest = text; match(rest, /[A-Za-z_][A-Za-z0-9_.']*/); rest = substr(rest, RSTART + RLENGTH)) {
        word = substr(rest, RSTART, RLENGTH)
        sub(/\.$/, "", word)
        if (word in ours && !(word in bound)) named[word]
    }
    text = ""
}

FNR == 1 { module = FILENAME; gsub(/.*\/|\.v$/, "", module) }
FILENAME ~ /\.v$/ {
    if ($1 ~ /^(Definition|Fixpoint|Record|Inductive)$/) {
        sub(/[^A-Za-z0-9_'].*/, "", $2)
        ours[$2]
        ours[module "." $2]
    }
    next
}
# An answer begins.
/^[A-Za-z0-9_.']+( =.*| *)$/ || /^(Record|Inductive|Arguments) / {
    take()
    aside = $1 == "Arguments"
    record = $1 ~ /^(Record|Inductive)$/
    if (record && NF == 1) { getline line; $0 = $1 " " line }
    printed[record ? $2 : $1]
}
/\.\.\./ { named["(all of an answer: ...)"] }
!aside { text = text " " $0 }
END { take(); for (word in named) if (!(word in printed)) print word }

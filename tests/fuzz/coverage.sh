#!/bin/sh
# Says how many lines of each decoder the corpora reach, and fails below 95 %:
#
#   CC=clang CXX=clang++ meson setup BUILD -Dlibfuzzer=true -Db_lundef=false \
#       -Dc_args='-fprofile-instr-generate -fcoverage-mapping' \
#       -Dc_link_args=-fprofile-instr-generate -Dcpp_link_args=-fprofile-instr-generate
#   ninja -C BUILD fuzzers && tests/fuzz/coverage.sh BUILD
#
# The decoders are the files of the table in docs/fuzzing.md. Files hold more than what reads: encoders,
# sockets. Functions that no target enters are named, not counted.
set -eu
root=$(cd "$(dirname "$0")/../.." && pwd)
build=$1
objects=
rm -f "$build"/*.profraw
for target in "$build"/tests/fuzz/fuzz_*; do
    [ -f "$target" ] || continue
    LLVM_PROFILE_FILE=$build/${target##*/}.profraw "$target" -runs=0 \
        "$root/tests/fuzz/corpus/${target##*/fuzz_}" 2>"$build/fuzz.log" ||
        { tail -n 20 "$build/fuzz.log" >&2; exit 1; }
    objects="$objects ${objects:+-object }$target"
done
llvm-profdata merge -o "$build/all.profdata" "$build"/*.profraw
# shellcheck disable=SC2016 # backquotes of Markdown
sed -n 's/^| `\([a-z_/]*\.c\)` .*/\1/p' "$root/docs/fuzzing.md" >"$build/decoders"
# shellcheck disable=SC2086 # several words
llvm-cov export -format=lcov -instr-profile "$build/all.profdata" $objects |
    awk -F '[:,]' -v decoders="$build/decoders" '
        BEGIN { while ((getline name < decoders) > 0) wanted[name] = 1 }
        $1 == "SF" {
            n = split($2, part, "/")
            file = part[n - 1] "/" part[n]
        }
        !(file in wanted) { next }
        $1 == "FN" { begins[file, $2] = $3 } # of static functions the name is FILE.c:NAME
        $1 == "FN" && NF > 3 { begins[file, $2] = $4 }
        $1 == "FNDA" { entered[file, $NF] += $2 }
        $1 == "DA" { hits[file, $2] += $3; if ($2 > last[file]) last[file] = $2 }
        END {
            for (file in wanted) {
                count = hit = 0
                function_name = missing = ""
                for (i = 1; i <= last[file]; i++) {
                    if ((file, i) in begins) {
                        function_name = begins[file, i]
                        if (!entered[file, function_name]) missing = missing " " function_name
                    }
                    if ((file, i) in hits && entered[file, function_name]) {
                        count++
                        hit += hits[file, i] > 0
                    }
                }
                percent = count ? 100 * hit / count : 0
                low += percent < 95
                missing = missing ? "  not entered:" missing : ""
                printf "%-28s %4d lines %6.2f %%%s\n", file, count, percent, missing | "sort"
            }
            close("sort")
            exit low > 0
        }'

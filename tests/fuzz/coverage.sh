#!/bin/sh
# Says how many lines of each decoder the suite `unit` reaches: what replays the corpora, cut and
# changed; then that with the other tests. Fails where the latter is below 95 %:
#
#   CC=clang CXX=clang++ meson setup BUILD -Dc_args='-fprofile-instr-generate -fcoverage-mapping' \
#       -Dc_link_args=-fprofile-instr-generate -Dcpp_link_args=-fprofile-instr-generate
#   tests/fuzz/coverage.sh BUILD
#
# The decoders are the files of the table in docs/fuzzing.md. Files hold more than what reads: encoders,
# sockets. Functions that no test enters are named, not counted.
set -eu
root=$(cd "$(dirname "$0")/../.." && pwd)
build=$(cd "$1" && pwd)
rm -rf "$build/profiles"
# shellcheck disable=SC2016 # backquotes of Markdown
sed -n 's/^| `\([a-z_/]*\.c\)` .*/\1/p' "$root/docs/fuzzing.md" >"$build/decoders"

# run_tests OPTION...: of meson test. A test's time is no matter.
run_tests()
{
    LLVM_PROFILE_FILE=$build/profiles/%m-%p.profraw OTWD_TESTS_ARE_SLOW=1 \
        meson test -C "$build" --num-processes 2 --timeout-multiplier 10 "$@" \
            >"$build/coverage.log" 2>&1 || { cat "$build/coverage.log" >&2; exit 1; }
}

# FILE, lines and share of those reached, per decoder, by what has run until now.
reached()
{
    find "$build/profiles" -name '*.profraw' >"$build/profiles/list"
    llvm-profdata merge -o "$build/all.profdata" -f "$build/profiles/list"
    objects=
    for program in "$build"/tests/test_* "$build"/tests/fuzz/fuzz_*; do
        [ ! -f "$program" ] || objects="$objects ${objects:+-object }$program"
    done
    # shellcheck disable=SC2086 # several words
    llvm-cov export -format=lcov -instr-profile "$build/all.profdata" $objects 2>/dev/null |
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
                    printf "%s %d %.1f%s\n", file, count, count ? 100 * hit / count : 0, missing
                }
            }' | sort
}

run_tests --suite replay
reached >"$build/replayed"
run_tests --suite unit --no-suite replay
reached | join "$build/replayed" - -o '1.1 1.3 2.2 2.3' | awk '
    { printf "%-28s %5.1f %%   of %4d lines %5.1f %%\n", $1, $2, $3, $4; low += $4 < 95 }
    END { exit low > 0 }'

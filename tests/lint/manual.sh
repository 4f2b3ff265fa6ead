#!/bin/sh
# The manual pages format without a warning and tell of every configuration key and subcommand.
. "$(dirname "$0")/common.sh"

sed -n 's/^    {"\([a-z_.]*\(\[\][a-z_.]*\)*\)",.*/\1/p' config/keys.c | while read -r key; do
    leaf=${key##*.}
    leaf=${leaf%\[]}
    grep -q "^\.It Ic ${leaf}\$\|^\.It Ic ${leaf} " docs/man/otwd.yaml.5 ||
        complain "docs/man/otwd.yaml.5 does not tell of $key"
done
for name in run replay demo import merge info verify height dig send bench status check-config; do
    grep -q "^\.Ss otwd $name\|^\.It Ic $name" docs/man/otwd.1 ||
        complain "docs/man/otwd.1 does not tell of $name"
    grep -qw -- "$name" docs/completion/otwd.bash ||
        complain "docs/completion/otwd.bash does not know $name"
done
command -v groff >/dev/null || skip "groff is not installed"
for page in docs/man/otwd.1 docs/man/otwd.yaml.5; do
    warnings=$(groff -mandoc -ww -Tutf8 "$page" 2>&1 >/dev/null)
    [ -z "$warnings" ] || complain "$page: $warnings"
done
finish

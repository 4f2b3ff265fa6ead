# bash completion for otwd                                               -*- shell-script -*-

# The options of a subcommand (and its subject), from its own help, which cannot be out of date.
_otwd_options() {
    "$@" --help 2>/dev/null | sed -n 's/^ *\(-., \)\{0,1\} *\(--[a-z-]*\).*/\2/p'
}

# The words that an option takes; nothing where it takes a file or free text.
_otwd_values() {
    case $1 in
    --technique) echo "clipmap" ;;
    --protocol) echo "native flightgear xplane dis canaerospace cigi3 cigi4" ;;
    --vertical) echo "egm96 egm2008 egm84 ellipsoid" ;;
    --datum) echo "egm96 ellipsoid" ;;
    --speed) echo "max" ;;
    --samples) echo "1 4" ;;
    --techniques) "${COMP_WORDS[0]}" bench --techniques '?' 2>&1 | sed -n 's/.*there are/all/p' | tr -d , ;;
    bench) [[ $current == -* ]] || echo "codec motion quality stability" ;;
    --flight) [ "${COMP_WORDS[2]}" != stability ] || echo "taxi low dash fast high descent climb creep" ;;
    --to) echo "udp:// can: sim:" ;;
    esac
}

_otwd() {
    local current=${COMP_WORDS[COMP_CWORD]} previous=${COMP_WORDS[COMP_CWORD - 1]} values options words=2
    COMPREPLY=()
    if [ "$COMP_CWORD" -eq 1 ]; then
        mapfile -t COMPREPLY < <(compgen -W "run replay demo import merge info verify height dig send
            bench status check-config --help --version" -- "$current")
        return
    fi
    values=$(_otwd_values "$previous")
    if [ -n "$values" ]; then
        mapfile -t COMPREPLY < <(compgen -W "$values" -- "$current")
    elif [[ $current == -* ]]; then
        [[ ${COMP_WORDS[1]} != bench || ${COMP_WORDS[2]} == -* ]] || words=3
        options=$(_otwd_options "${COMP_WORDS[@]:0:words}")
        mapfile -t COMPREPLY < <(compgen -W "$options" -- "$current")
    else
        mapfile -t COMPREPLY < <(compgen -f -- "$current")
    fi
}

complete -o filenames -F _otwd otwd

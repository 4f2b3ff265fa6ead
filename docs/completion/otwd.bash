# bash completion for otwd                                               -*- shell-script -*-

_otwd_options() {
    case $1 in
    run) echo "-c --config --quiet --verbose" ;;
    replay)
        echo "-c --config --terrain --geoid --size --rate --speed --technique --pixel-error" \
            "--time-utc --frames --every --video --geo --report --protocol --json --quiet"
        ;;
    demo) echo "--out --no-video --size --rate --quiet" ;;
    import)
        echo "-o --output --max-error --vertical --geoid --crs --nodata --priority --jobs" \
            "--json --quiet --version"
        ;;
    info) echo "--json" ;;
    verify | check-config) echo "--json --quiet" ;;
    height) echo "--datum --normal" ;;
    send) echo "--to --protocol --rate --speed --jitter-ms --loss --reorder --seed --quiet" ;;
    status) echo "--modbus --unit --timeout-ms --json" ;;
    esac
    echo "--help"
}

# The words that a subcommand's option takes; nothing where it takes a file or free text.
_otwd_values() {
    case $1:$2 in
    replay:--technique) echo "clipmap" ;;
    replay:--protocol) echo "native flightgear" ;;
    replay:--speed) echo "max" ;;
    import:--vertical) echo "egm96 egm2008 egm84 ellipsoid" ;;
    height:--datum) echo "egm96 ellipsoid" ;;
    send:--protocol) echo "native flightgear canaerospace" ;;
    send:--to) echo "udp:// can: sim:" ;;
    esac
}

_otwd() {
    local current=${COMP_WORDS[COMP_CWORD]} previous=${COMP_WORDS[COMP_CWORD - 1]} values
    COMPREPLY=()
    if [ "$COMP_CWORD" -eq 1 ]; then
        mapfile -t COMPREPLY < <(compgen -W "run replay demo import info verify height send status
            check-config --help --version" -- "$current")
        return
    fi
    values=$(_otwd_values "${COMP_WORDS[1]}" "$previous")
    if [ -n "$values" ]; then
        mapfile -t COMPREPLY < <(compgen -W "$values" -- "$current")
    elif [[ $current == -* ]]; then
        mapfile -t COMPREPLY < <(compgen -W "$(_otwd_options "${COMP_WORDS[1]}")" -- "$current")
    else
        mapfile -t COMPREPLY < <(compgen -f -- "$current")
    fi
}

complete -o filenames -F _otwd otwd

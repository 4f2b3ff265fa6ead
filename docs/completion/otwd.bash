# bash completion for otwd                                               -*- shell-script -*-

_otwd_options() {
    case $1 in
    run) echo "-c -v --quiet" ;;
    replay)
        echo "-c --terrain --size --rate --speed --technique --pixel-error --frames --every" \
            "--video --geo --report --protocol"
        ;;
    demo) echo "--out" ;;
    import) echo "-o --max-error --vertical --geoid --crs --nodata --priority --jobs --shard --imagery" ;;
    height) echo "--datum --normal" ;;
    send) echo "--to --protocol --rate --speed --jitter-ms --loss --reorder --seed" ;;
    status) echo "--modbus --unit --timeout-ms" ;;
    esac
    echo "--help --version --json --quiet -v"
}

# The words that an option takes; nothing where it takes a file or free text.
_otwd_values() {
    case $1 in
    --technique) echo "clipmap" ;;
    --protocol) echo "native flightgear canaerospace" ;;
    --vertical) echo "egm96 egm2008 egm84 ellipsoid" ;;
    --datum) echo "egm96 ellipsoid" ;;
    --speed) echo "max" ;;
    --to) echo "udp:// can: sim:" ;;
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
    values=$(_otwd_values "$previous")
    if [ -n "$values" ]; then
        mapfile -t COMPREPLY < <(compgen -W "$values" -- "$current")
    elif [[ $current == -* ]]; then
        mapfile -t COMPREPLY < <(compgen -W "$(_otwd_options "${COMP_WORDS[1]}")" -- "$current")
    else
        mapfile -t COMPREPLY < <(compgen -f -- "$current")
    fi
}

complete -o filenames -F _otwd otwd

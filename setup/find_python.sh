# Sourced by ../irsbot.
# shellcheck shell=bash

# Prints the interpreter that runs the set-up, or says on stderr what is missing.
find_python() {
    local root=$1 candidate lack seen=""
    if [[ -n ${IRSBOT_PYTHON:-} ]]; then
        set -- "$IRSBOT_PYTHON"
    elif [[ $IRSBOT_ROS == wheels && -x $root/.venv/bin/python ]]; then
        set -- "$root/.venv/bin/python" python3 python3.12 python3.11 python3.10
    else
        set -- python3 python3.12 python3.11 python3.10
    fi
    for candidate; do
        command -v -- "$candidate" >/dev/null || continue
        lack=$(python_lack "$candidate")
        if [[ -z $lack ]]; then
            command -v -- "$candidate"
            return
        fi
        seen+="${seen:+, }$candidate $lack"
    done
    echo "irsbot: no suitable Python (${seen:-none found}): install Python 3.10, 3.11 or 3.12 with headers and venv," \
        "for instance with 'apt install python3 python3-dev python3-venv', or name one in IRSBOT_PYTHON" >&2
    return 1
}

# Prints what keeps an interpreter from being used, nothing if it is suitable.
python_lack() {
    "$1" -E -S -c '
import os, sys
if not (3, 10) <= sys.version_info[:2] <= (3, 12):
    print("is Python %d.%d" % sys.version_info[:2])
    sys.exit()
import importlib.util, sysconfig
if not importlib.util.find_spec("ensurepip") or not importlib.util.find_spec("venv"):
    print("has no venv")
elif not os.path.exists(os.path.join(sysconfig.get_paths()["include"], "Python.h")):
    print("has no headers")
' 2>/dev/null || echo "does not run"
}

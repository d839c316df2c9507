#!/usr/bin/env bash
# Installs a wheel into fresh venvs and uses it as a newcomer does, without ffmpeg in PATH. usage: packaging/try.sh WHEEL [PYTHON ...]
set -euo pipefail
wheel=$(realpath "$1")
shift
[ $# -gt 0 ] || set -- python3
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
for python in "$@"; do
  echo "== $("$python" --version)"
  venv=$work/$(basename "$python")
  "$python" -m venv "$venv"
  "$venv/bin/python" -m pip install -q --disable-pip-version-check "mjsense[video] @ file://$wheel"
  (
    cd "$work"
    export PATH=$venv/bin  # no ffmpeg but that of imageio-ffmpeg
    time python -c 'import mjsense'
    mjsense --version
    mjsense record pick --episodes 2 --worlds 2 --size 64x48 --out "$venv/data" --quiet
    mjsense verify --decode "$venv/data"
  )
done

#!/usr/bin/env bash
# Installs a wheel into fresh venvs and uses it as a newcomer does, without ffmpeg in PATH. usage: packaging/try.sh WHEEL [PYTHON ...]
set -euo pipefail
wheel=$(realpath "$1")
newcomer=$(realpath "$(dirname "${BASH_SOURCE[0]}")/newcomer.sh")
shift
[ $# -gt 0 ] || set -- python3
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
for python in "$@"; do
  echo "== $("$python" --version)"
  venv=$work/$(basename "$python")
  "$python" -m venv "$venv"
  "$venv/bin/python" -m pip install -q --disable-pip-version-check "mjsense[video] @ file://$wheel" h5py
  "$newcomer" "$venv"
done

#!/usr/bin/env bash
# Installs a wheel with all its extras, and with each of the packages in packaging/resolve.py, into separate environments, and runs the
# tests that need these packages. Slow; torch downloads CUDA, 6 GB. usage: packaging/matrix.sh WHEEL [NAME ...]
set -euo pipefail
wheel=$(realpath "$1")
shift
cd "$(dirname "${BASH_SOURCE[0]}")/.."
python=$PWD/.venv/bin/python
if [ $# = 0 ]; then
  mapfile -t names < <(cd packaging && "$python" -c 'import resolve; print(*resolve.ENVIRONMENTS, sep="\n")')
  set -- "${names[@]}"
fi
failed=0
for name in "$@"; do
  echo "== $name"
  venv=build/matrix/${name// /-}
  rm -rf "$venv"
  "$python" -m venv "$venv"
  mapfile -t others < <(cd packaging && "$python" -c 'import resolve, sys; [print(r) for r in resolve.ENVIRONMENTS[sys.argv[1]]]' "$name")
  "$venv/bin/python" -m pip install -q --disable-pip-version-check "$wheel" pytest h5py "${others[@]}" || { failed=1; continue; }
  "$venv/bin/python" -m pip check || failed=1
  "$venv/bin/python" -m pip list --disable-pip-version-check --format freeze | grep -i -E '^(mujoco|torch|numpy|gymnasium|h5py|rsl|stable)' || true
  mujoco=$("$venv/bin/python" -c 'import mujoco; print(mujoco.__version__)' 2>/dev/null || true)
  for order in ${mujoco:+mujoco-first mjsense-first} alone; do
    "$venv/bin/python" -W ignore tests/python/other_mujoco.py "$order" "$(mktemp -d)" || failed=1
  done
  tests=(tests/python/test_load_order.py tests/python/test_rl.py)
  case $mujoco in 4.0.*) tests+=(tests/python/test_libmujoco.py tests/python/test_mujoco_views.py tests/python/test_mjlab_compat.py) ;; esac
  "$venv/bin/python" -m pytest -q -p no:cacheprovider "${tests[@]}" || failed=1
done
exit $failed

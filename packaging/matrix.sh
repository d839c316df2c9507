#!/usr/bin/env bash
# Installs a wheel with all its extras, and with each of the packages in packaging/resolve.py, into separate environments, and runs the
# tests that need these packages, for each Python of MJSENSE_PYTHONS (by default that of .venv). Without arguments after WHEEL it is slow:
# torch downloads CUDA, 6 GB. usage: packaging/matrix.sh WHEEL [NAME ...]
#
#   MJSENSE_PYTHONS="python3.11 python3.13" packaging/matrix.sh dist/*.whl "mujoco 3.3" "mujoco 3.8" "mujoco 3.11" "mujoco 3.17" mujoco
set -euo pipefail
wheel=$(realpath "$1")
shift
cd "$(dirname "${BASH_SOURCE[0]}")/.."
python=$PWD/.venv/bin/python
read -ra pythons <<< "${MJSENSE_PYTHONS:-$python}"
if [ $# = 0 ]; then
  mapfile -t names < <(cd packaging && "$python" -c 'import resolve; print(*resolve.ENVIRONMENTS, sep="\n")')
  set -- "${names[@]}"
fi
failures=()

# check WHAT COMMAND...: runs a command and records its failure.
check() {
  local what=$1
  shift
  if "$@"; then echo "pass: $what"; else failures+=("$what") && echo "FAIL: $what"; fi
}

environment() { # PYTHON NAME
  local version venv mujoco order others tests
  version=$("$1" -c 'import sys; print("%d.%d" % sys.version_info[:2])')
  local what="Python $version, $2"
  echo "== $what"
  venv=build/matrix/$version-${2// /-}
  rm -rf "$venv"
  "$1" -m venv "$venv"
  mapfile -t others < <(cd packaging && "$python" -c 'import resolve, sys; [print(r) for r in resolve.ENVIRONMENTS[sys.argv[1]]]' "$2")
  if ! "$venv/bin/python" -m pip install -q --disable-pip-version-check "$wheel" pytest h5py PyOpenGL imageio "${others[@]}"; then
    failures+=("$what: pip install")
    return
  fi
  check "$what: pip check" "$venv/bin/python" -m pip check --disable-pip-version-check
  "$venv/bin/python" -m pip list --disable-pip-version-check --format freeze | grep -i -E '^(mujoco|torch|numpy|gymnasium|h5py|rsl|stable)' || true
  mujoco=$("$venv/bin/python" -c 'import mujoco; print(mujoco.__version__)' 2>/dev/null || true)
  for order in ${mujoco:+mujoco-first mjsense-first} alone; do
    check "$what: $order" "$venv/bin/python" -W ignore tests/python/other_mujoco.py "$order" "$(mktemp -d)"
  done
  tests=(tests/python/test_load_order.py)
  case $mujoco in
    4.0.*) tests+=(tests/python/test_{rl,libmujoco,mujoco_views,mjlab_compat}.py) ;;
    "") tests+=(tests/python/test_rl.py) ;;
  esac
  check "$what: tests" "$venv/bin/python" -m pytest -q -p no:cacheprovider "${tests[@]}"
  # Images against this version's OpenGL renderer, and in the subprocesses of Gymnasium, Stable-Baselines3 and PyTorch where they are installed.
  [ -z "$mujoco" ] || check "$what: images" "$venv/bin/python" -m pytest -q -p no:cacheprovider tests/python/test_renderer.py tests/python/test_renderer_opengl.py -k "look_as_in_opengl or processes or workers"
}

for each in "${pythons[@]}"; do
  for name in "$@"; do environment "$each" "$name"; done
done
echo
if [ ${#failures[@]} = 0 ]; then
  echo "all passed"
else
  printf 'failed: %s\n' "${failures[@]}"
  exit 1
fi

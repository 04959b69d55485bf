#!/usr/bin/env bash
# All tests, run by `make test` in the environment of env.sh; arguments go to pytest.
# On a machine that stands still for seconds a test over the middleware may fail for that: what failed is tried once
# more, alone. How it failed first is kept in a file: a test that passes only the second time is still a fault to find.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
kept=${FIRST_FAILURES:-out/first_failures.txt}
mkdir -p "$(dirname "$kept")"
rm -f "$kept"

# Kept for the next run: half of what loading all tests costs. Containers often tell Python to keep none.
unset PYTHONDONTWRITEBYTECODE

# One worker more than there are processors: a test over the middleware waits for a quarter of its time.
export PYTEST_XDIST_AUTO_NUM_WORKERS=${PYTEST_XDIST_AUTO_NUM_WORKERS:-$(($(nproc) + 1))}
code=0
PYTHONPATH="$PWD/tests${PYTHONPATH:+:$PYTHONPATH}" python -m pytest --numprocesses auto --maxprocesses 4 --dist loadfile \
  --no-loadscope-reorder \
  -p keep_failures --keep-failures "$kept" "$@" || code=$?
if [ $code -ne 1 ]; then
  exit $code
fi
echo "Once more, alone: what has failed. How it failed is kept in $kept."
python -m pytest --last-failed --last-failed-no-failures none "$@"
echo "Passed only when tried again, alone (how they failed first: $kept):"
sed -n 's/^=== /  /p' "$kept"

#!/bin/bash
# Run a command in the environment of the workspace.
. /opt/afm/env.sh || exit
exec "$@"

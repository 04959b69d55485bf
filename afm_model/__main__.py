"""What `python -m afm_model` finds in the clone as long as nothing is set up."""

import sys

sys.exit("error: the packages are not found: run `. ./env.sh` in this folder first, once per terminal")

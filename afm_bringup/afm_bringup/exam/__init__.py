"""The examination of a controller: whether it keeps the contract of a drive, rule by rule."""

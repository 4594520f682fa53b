"""The algorithm and how it is run. `pipeline` is the algorithm; `methods` are its parts by name; `config` has every
number that may be set; `session` runs it on a recording; `runfolder` is what a run leaves."""

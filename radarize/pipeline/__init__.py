"""The algorithm and how it is run: `pipeline` has its steps, `methods` their implementations by name, `config` all
settings, `session` a run on a recording, `runfolder` the files of a run."""

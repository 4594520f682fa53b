"""The commands of `radarize`. Each loads what is heavy when it is called, so that --help is instant."""

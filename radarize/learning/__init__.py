"""Networks: `features` (what they see), `nets` (what they are), `training`, `task` (what a training needs to know), and
the shipped `weights`."""

"""Networks: their input (`features`), their architectures (`nets`), `training`, the definition of a training (`task`),
and the shipped `weights`."""

"""Problems with controls that are singular on an arc: neither on a bound nor given by the first derivatives."""

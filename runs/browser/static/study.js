"use strict";
// What a study has beside its points: the state of its runs, comparisons of solvers, and tables.

function showStudy() {}

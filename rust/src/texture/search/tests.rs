//! The same tests for every backend.

use super::penalty::{IndexHistogram, RunPenalty};
use super::*;
use crate::monitor::Monitor;
use crate::texture::field::Field;
use crate::texture::match_map::random_blocks;
use crate::texture::pyramid::gaussian;
use crate::texture::symmetry::Symmetry;
use crate::volume::{Boundary, voxels};

const WINDOW: usize = 4;

fn exemplar() -> Field {
    let key = Key::new(3);
    let noise = (0..voxels([16, 15, 14])).map(|i| 255.0 * key.unit(i as u64)).collect();
    gaussian(&Field::new([16, 15, 14], 1, noise).unwrap(), 1.0, Boundary::Open)
}

fn neighbourhoods(field: &Field, symmetry: Symmetry) -> Neighbourhoods<'_> {
    let all = symmetry.orientations(None);
    Neighbourhoods::new(field, [WINDOW; 3], &all, (16, 0.99), Key::new(0), &Monitor::silent())
        .unwrap()
}

/// Backends, and how many passes each gets.
fn backends(set: &Neighbourhoods<'_>) -> Vec<(&'static str, Box<dyn Search>, usize)> {
    vec![
        ("brute force", Box::new(BruteForce), 1),
        ("kd-tree", Box::new(KdTree::new(set, set.len()).unwrap()), 1),
        ("coherent", Box::new(Coherent), 60),
    ]
}

struct Setting {
    map: MatchMap,
    queries: Vec<i16>,
    truth: Vec<Match>,
}

/// Sites whose windows are windows of the exemplar, from a map that knows nothing of them.
fn setting(field: &Field, set: &Neighbourhoods<'_>) -> Setting {
    let (_, map) = random_blocks(field, [12; 3], WINDOW, Boundary::Open, Key::new(1));
    let key = Key::new(8);
    let truth: Vec<Match> =
        (0..map.matches.len()).map(|i| set.match_at(key.below(i as u64, set.len()))).collect();
    let queries = truth.iter().flat_map(|m| set.descriptor(set.index(*m)).to_vec()).collect();
    Setting { map, queries, truth }
}

fn run(
    backend: &dyn Search,
    set: &Neighbourhoods<'_>,
    setting: &Setting,
    passes: usize,
    histogram: impl Fn(&MatchMap) -> Option<IndexHistogram>,
    penalty: Option<RunPenalty>,
) -> Vec<Match> {
    let mut map = setting.map.clone();
    let lattice = map.lattice.clone();
    for pass in 0..passes {
        let mut out = vec![Match::NONE; map.matches.len()];
        let scene =
            Scene::new(set, &map, &lattice, histogram(&map), penalty, Key::new(pass as u64));
        backend.search(&scene, 0, &setting.queries, &vec![true; out.len()], &mut out);
        map.matches = out;
    }
    map.matches
}

fn distance(set: &Neighbourhoods<'_>, a: Match, b: Match) -> i32 {
    squared_distance(set.descriptor(set.index(a)), set.descriptor(set.index(b)))
}

#[test]
fn exact_backends_find_a_window_that_is_there_and_coherent_search_comes_near() {
    let field = exemplar();
    for symmetry in [Symmetry::None, Symmetry::Flips] {
        let set = neighbourhoods(&field, symmetry);
        let s = setting(&field, &set);
        let typical = 2.0 * set.spread();
        for (name, backend, passes) in backends(&set) {
            let found = run(&*backend, &set, &s, passes, |_| None, None);
            let off: f32 =
                found.iter().zip(&s.truth).map(|(a, b)| distance(&set, *a, *b) as f32).sum();
            let mean = off / found.len() as f32;
            let allowed = if backend.improves() { 0.3 * typical } else { 0.0 };
            assert!(mean <= allowed, "{name} {symmetry:?}: {mean} of {typical}");
        }
    }
}

#[test]
fn every_match_is_a_window_of_the_exemplar() {
    let field = exemplar();
    let set = neighbourhoods(&field, Symmetry::Rotations);
    let s = setting(&field, &set);
    for (name, backend, _) in backends(&set) {
        for m in run(&*backend, &set, &s, 2, |_| None, None) {
            let limit = set.limit(m.orientation);
            assert!((0..3).all(|a| usize::from(m.origin[a]) <= limit[a]), "{name}");
        }
    }
}

#[test]
fn all_ties_are_resolved_to_a_valid_window() {
    let field = Field::new([8; 3], 1, vec![100.0; 512]).unwrap();
    let set = neighbourhoods(&field, Symmetry::None);
    let s = setting(&field, &set);
    for (name, backend, _) in backends(&set) {
        let found = run(&*backend, &set, &s, 1, |_| None, None);
        assert!(found.iter().all(|m| m.is_some()), "{name}");
    }
}

#[test]
fn the_kd_tree_spreads_over_equal_windows() {
    let field = Field::new([40; 3], 1, vec![100.0; 64_000]).unwrap();
    let set = neighbourhoods(&field, Symmetry::None);
    let s = setting(&field, &set);
    let tree = KdTree::new(&set, 10).unwrap();
    let mut found = run(&tree, &set, &s, 1, |_| None, None);
    let sites = found.len();
    found.sort_unstable();
    found.dedup();
    assert!(2 * found.len() > sites, "{} of {sites}", found.len());
}

#[test]
fn sites_outside_the_domain_are_left_alone() {
    let field = exemplar();
    let set = neighbourhoods(&field, Symmetry::None);
    let s = setting(&field, &set);
    for (name, backend, _) in backends(&set) {
        let lattice = s.map.lattice.clone();
        let scene = Scene::new(&set, &s.map, &lattice, None, None, Key::new(0));
        let mut out = vec![Match::NONE; s.truth.len()];
        let active: Vec<bool> = (0..out.len()).map(|i| i % 2 == 0).collect();
        backend.search(&scene, 0, &s.queries, &active, &mut out);
        assert!(out.iter().zip(&active).all(|(m, a)| m.is_some() == *a), "{name}");
    }
}

#[test]
fn the_index_histogram_drives_sites_away_from_a_window_that_all_use() {
    let field = exemplar();
    let set = neighbourhoods(&field, Symmetry::None);
    let mut s = setting(&field, &set);
    // Every site asks for something near one window, and every site used that window before.
    let popular = set.match_at(77);
    let near = set.match_at(78);
    s.queries = s
        .truth
        .iter()
        .flat_map(|_| {
            let (a, b) = (set.descriptor(77), set.descriptor(78));
            a.iter().zip(b).map(|(a, b)| a + (b - a) / 4).collect::<Vec<_>>()
        })
        .collect();
    s.map.matches.fill(popular);
    for (name, backend, _) in backends(&set) {
        let plain = run(&*backend, &set, &s, 1, |_| None, None);
        assert!(plain.iter().all(|m| *m == popular), "{name}");
        let literal =
            run(&*backend, &set, &s, 1, |m| Some(IndexHistogram::new(m, &set, false)), None);
        assert!(literal.iter().all(|m| *m == popular), "{name}: at most doubles a small distance");
        let normalised =
            run(&*backend, &set, &s, 1, |m| Some(IndexHistogram::new(m, &set, true)), None);
        let stay = normalised.iter().filter(|m| **m == popular).count();
        assert!(stay < normalised.len(), "{name}: {stay} {near:?}");
    }
}

#[test]
fn the_run_penalty_breaks_up_a_verbatim_copy() {
    let field = exemplar();
    let set = neighbourhoods(&field, Symmetry::None);
    // The output is a copy of a corner of the exemplar, and the map says so.
    let lattice = Lattice::new([12, 12, 12], [WINDOW; 3], [2; 3], [0; 3], Boundary::Open);
    let truth: Vec<Match> = super::super::match_map::product(&lattice.origins)
        .map(|o| Match { orientation: 0, origin: o.map(|v| v as u16) })
        .collect();
    let queries = truth.iter().flat_map(|m| set.descriptor(set.index(*m)).to_vec()).collect();
    let s = Setting { map: MatchMap { lattice, matches: truth.clone() }, queries, truth };
    for (name, backend, _) in backends(&set) {
        let plain = run(&*backend, &set, &s, 1, |_| None, None);
        assert_eq!(plain, s.truth, "{name}");
        let penalty = RunPenalty { reach: 4, cost: 10.0 * set.spread() };
        let broken = run(&*backend, &set, &s, 1, |_| None, Some(penalty));
        let kept = broken.iter().zip(&s.truth).filter(|(a, b)| a == b).count();
        assert!(kept < s.truth.len() / 10, "{name}: {kept}");
    }
}

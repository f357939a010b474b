//! Scalars of campaigns. A query finds each of them with few rows of an index, so that a list of many campaigns can be sorted by
//! them.

use super::{Store, StoreError, hidden::HIDDEN};
use murmuration_model::{CampaignId, Scalar};
use rusqlite::{Row, params};
use std::collections::HashMap;

/// The scalar of the campaign `c`, in SQL; NULL if the campaign does not have it.
const fn sql(scalar: Scalar) -> &'static str {
    match scalar {
        Scalar::Evaluations => {
            "coalesce((SELECT first + individuals FROM individual_chunks WHERE campaign = c.number ORDER BY first DESC LIMIT 1), 0)"
        }
        Scalar::Generations => {
            "coalesce((SELECT max(generation) + 1 FROM generations WHERE campaign = c.number), 0)"
        }
        // A campaign whose method has no novelty stores a novelty of 0.
        Scalar::BestNovelty => {
            "nullif((SELECT best_novelty FROM generations WHERE campaign = c.number ORDER BY generation DESC LIMIT 1), 0)"
        }
        Scalar::MeanNovelty => {
            "nullif((SELECT mean_novelty FROM generations WHERE campaign = c.number ORDER BY generation DESC LIMIT 1), 0)"
        }
        Scalar::Clusters => {
            "(SELECT octet_length(medoids) / 8 FROM taxonomies WHERE campaign = c.number AND stands)"
        }
        Scalar::LabelEntries => "coalesce((SELECT max(entry) + 1 FROM labels WHERE campaign = c.number), 0)",
        Scalar::Loss => {
            "(SELECT loss FROM epochs WHERE campaign = c.number ORDER BY round DESC, epoch DESC LIMIT 1)"
        }
        Scalar::Accuracy => {
            "(SELECT accuracy FROM epochs WHERE campaign = c.number ORDER BY round DESC, epoch DESC LIMIT 1)"
        }
        Scalar::Duration => {
            "coalesce(c.ended_ms, iif(c.state = 'running', unixepoch('subsec') * 1000, NULL)) - c.created_ms"
        }
    }
}

/// A query for scalars of campaigns, after the campaign's id.
fn select(scalars: &[Scalar]) -> String {
    let columns: String = scalars
        .iter()
        .map(|scalar| format!(", CAST({} AS REAL)", sql(*scalar)))
        .collect();
    format!("SELECT c.id{columns} FROM campaigns c WHERE c.state <> ?1")
}

impl Store {
    /// A scalar of every campaign that has it.
    pub fn scalar(&self, scalar: Scalar) -> Result<HashMap<CampaignId, f64>, StoreError> {
        self.read(|connection| {
            let mut statement = connection.prepare_cached(&select(&[scalar]))?;
            let value = |row: &Row<'_>| -> rusqlite::Result<_> {
                let value: Option<f64> = row.get(1)?;
                Ok((CampaignId::from_store(row.get(0)?), value))
            };
            let mut values = HashMap::new();
            for row in statement.query_map([HIDDEN], value)? {
                let (id, value) = row?;
                values.extend(value.map(|value| (id, value)));
            }
            Ok(values)
        })
    }

    /// For each of these campaigns, the values of `scalars`, in order. Campaigns that do not exist are skipped,
    /// and so are all campaigns if no scalar is asked for.
    pub fn scalars(
        &self,
        campaigns: &[CampaignId],
        scalars: &[Scalar],
    ) -> Result<HashMap<CampaignId, Vec<Option<f64>>>, StoreError> {
        if scalars.is_empty() {
            return Ok(HashMap::new());
        }
        self.read(|connection| {
            let mut statement = connection.prepare(&format!("{} AND c.id = ?2", select(scalars)))?;
            let mut values = HashMap::new();
            for id in campaigns {
                let mut rows = statement.query(params![HIDDEN, id.as_str()])?;
                if let Some(row) = rows.next()? {
                    let own = (1..=scalars.len()).map(|column| row.get(column));
                    values.insert(id.clone(), own.collect::<Result<_, _>>()?);
                }
            }
            Ok(values)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{DataDirectory, EpochRecord};
    use murmuration_model::Weight;
    use murmuration_swarm::CampaignSpec;

    #[test]
    fn a_campaign_has_its_last_values_and_a_new_one_few() {
        let folder = tempfile::tempdir().unwrap();
        let store = Store::open(&DataDirectory::hold(folder.path()).unwrap()).unwrap();
        let spec = CampaignSpec::from_toml("model = \"single-sensor\"\nmethod = \"random\"").unwrap();
        let [one, new] = [5, 7].map(|at| store.create_campaign(&spec, Weight::default(), at).unwrap());
        let first = EpochRecord {
            round: 0,
            epoch: 1,
            loss: Some(0.5),
            accuracy: Some(0.75),
        };
        store.add_epoch(&one, &first).unwrap();
        store
            .add_epoch(
                &one,
                &EpochRecord {
                    round: 1,
                    loss: None,
                    ..first
                },
            )
            .unwrap();
        let rows = "INSERT INTO generations VALUES (1, 0, 3, 2, 0), (1, 1, 1.5, 1, 0), (2, 0, 0, 0, 0);
            INSERT INTO individual_chunks VALUES (1, 0, 20, 0, x'', x'', x'', x'', x''), (1, 20, 10, 0, x'', x'', x'', x'', x'');
            INSERT INTO taxonomies VALUES (1, 1, 1, NULL, NULL, 0, 2, zeroblob(24), x'', 0, x'', x'', x'');
            UPDATE campaigns SET ended_ms = 25, state = 'completed' WHERE number = 1";
        store
            .write(|transaction| Ok(transaction.execute_batch(rows)?))
            .unwrap();
        let scalars = [
            Scalar::Evaluations,
            Scalar::Generations,
            Scalar::BestNovelty,
            Scalar::MeanNovelty,
            Scalar::Clusters,
            Scalar::LabelEntries,
            Scalar::Loss,
            Scalar::Accuracy,
        ];
        let unknown = "other-9".parse().unwrap();
        let found = store
            .scalars(&[one.clone(), unknown, new.clone()], &scalars)
            .unwrap();
        let expected = [30.0, 2.0, 1.5, 1.0, 3.0, 0.0].map(Some).into_iter();
        let expected: Vec<_> = expected.chain([None, Some(0.75)]).collect();
        assert_eq!((found.len(), &found[&one]), (2, &expected));
        let few = [Some(0.0), Some(1.0), None, None, None, Some(0.0), None, None];
        assert_eq!(found[&new], few);
        for (place, scalar) in scalars.into_iter().enumerate() {
            let all = store.scalar(scalar).unwrap();
            assert_eq!(
                [all.get(&one).copied(), all.get(&new).copied()],
                [expected[place], few[place]]
            );
        }
        let durations = store.scalar(Scalar::Duration).unwrap();
        assert!(durations[&one] == 20.0 && durations[&new] > 1e12, "{durations:?}");
    }
}

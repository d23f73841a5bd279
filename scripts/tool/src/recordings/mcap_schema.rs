//! A type as a JSON schema (draft 2020-12), for readers of MCAP files.

use recording::{Field, Scalar, Schema};

use crate::json::{Object, quoted};

/// Returns the schema of the messages of a channel: the job, and a value of this type.
pub(super) fn of_message(schema: &Schema) -> String {
    let integer = Object::new().text("type", "integer").end();
    let parts = Object::new()
        .json("job", &integer)
        .json("value", &of(schema))
        .end();
    object(&parts, &["job".into(), "value".into()]).end()
}

fn object(properties: &str, required: &[String]) -> Object {
    let required: Vec<String> = required.iter().map(|name| quoted(name)).collect();
    Object::new()
        .text("type", "object")
        .json("properties", properties)
        .json("required", &format!("[{}]", required.join(",")))
}

fn of(schema: &Schema) -> String {
    let of_type = |name| Object::new().text("type", name);
    match schema {
        Schema::Scalar(Scalar::Bool) => of_type("boolean").end(),
        Schema::Scalar(Scalar::Char | Scalar::Text) => of_type("string").end(),
        // What is infinite or no number is null.
        Schema::Scalar(Scalar::F32 | Scalar::F64) => {
            Object::new().json("type", "[\"number\",\"null\"]").end()
        }
        Schema::Scalar(_) => of_type("integer").end(),
        Schema::Option(inner) => {
            let either = format!("[{},{}]", of(inner), of_type("null").end());
            Object::new().json("anyOf", &either).end()
        }
        Schema::List(element) => of_type("array").json("items", &of(element)).end(),
        Schema::Array(element, count) => of_type("array")
            .json("items", &of(element))
            .number("minItems", *count)
            .number("maxItems", *count)
            .end(),
        Schema::Tuple(elements) => {
            let items: Vec<String> = elements.iter().map(of).collect();
            let items = format!("[{}]", items.join(","));
            of_type("array").json("prefixItems", &items).end()
        }
        Schema::Struct(name, fields) => {
            let mut properties = Object::new();
            for Field { name, schema } in fields {
                properties = properties.json(name, &of(schema));
            }
            let names: Vec<String> = fields.iter().map(|field| field.name.clone()).collect();
            object(&properties.end(), &names).text("title", name).end()
        }
    }
}

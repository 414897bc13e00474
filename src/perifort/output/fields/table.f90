!> The table of output fields: all that a scene may name, and what is known of each.
module pd_output_fields_table
  use pd_base_error, only: internal_fault
  use pd_output_fields_bond_stress, only: bond_stress_field
  use pd_output_fields_damage, only: damage_field
  use pd_output_fields_deformation_gradient, only: deformation_gradient_field
  use pd_output_fields_dilatation, only: dilatation_field
  use pd_output_fields_displacement, only: displacement_field
  use pd_output_fields_energy_density, only: energy_density_field
  use pd_output_fields_field, only: output_field_type, rank_scalar
  use pd_output_fields_force_density, only: force_density_field
  use pd_output_fields_fragment, only: fragment_field
  use pd_output_fields_principal_stress, only: principal_stress_field
  use pd_output_fields_reaction, only: reaction_field
  use pd_output_fields_strain, only: strain_field
  use pd_output_fields_stress, only: stress_field
  use pd_output_fields_velocity, only: velocity_field
  use pd_output_fields_von_mises, only: von_mises_field
  use pd_scene_content_types, only: name_length
  implicit none (type, external)
  private
  public :: field_table_type, all_fields

  !> Fields in the order in which messages and the reference name them.
  type :: field_table_type
    private
    type(output_field_type), allocatable :: fields(:)
  contains
    procedure :: add
    procedure :: names
    procedure :: number_of
    procedure :: field
    procedure :: find_component
  end type field_table_type

contains

  !> The fields of the program. A field joins with a line here.
  type(field_table_type) function all_fields() result(table)
    call table%add(displacement_field())
    call table%add(velocity_field())
    call table%add(damage_field())
    call table%add(dilatation_field())
    call table%add(force_density_field())
    call table%add(energy_density_field())
    call table%add(deformation_gradient_field())
    call table%add(strain_field())
    call table%add(stress_field())
    call table%add(von_mises_field())
    call table%add(principal_stress_field())
    call table%add(bond_stress_field())
    call table%add(fragment_field())
    call table%add(reaction_field())
  end function all_fields

  !> Add a field at the end.
  subroutine add(table, field)
    class(field_table_type), intent(inout) :: table
    type(output_field_type), intent(in) :: field  !! of a name that is new

    if (.not. allocated(table%fields)) allocate (table%fields(0))
    if (table%number_of(field%name) > 0) &
      & call internal_fault('two fields of the output are named '//trim(field%name))
    if (.not. (associated(field%fill) .or. associated(field%of_gradient))) &
      & call internal_fault('nothing computes the field '//trim(field%name))
    table%fields = [table%fields, field]
  end subroutine add

  !> Names of all fields.
  pure function names(table)
    class(field_table_type), intent(in) :: table
    character(name_length), allocatable :: names(:)

    allocate (names(0))
    if (allocated(table%fields)) names = table%fields%name
  end function names

  !> Place of the field `name` in the table, 0 if there is none.
  pure integer function number_of(table, name) result(number)
    class(field_table_type), intent(in) :: table
    character(*), intent(in) :: name

    number = 0
    if (allocated(table%fields)) number = findloc(table%fields%name == name, .true., dim=1)
  end function number_of

  !> The field `name`, which must be in the table: `check_names` has refused others.
  pure type(output_field_type) function field(table, name)
    class(field_table_type), intent(in) :: table
    character(*), intent(in) :: name
    integer :: number

    number = table%number_of(name)
    if (number == 0) call internal_fault('no field of the output is named '//trim(name))
    field = table%fields(number)
  end function field

  !> The field and component that a text names in `dim` dimensions: `velocity` is all components
  !> (0), `velocity_x` the first.
  pure subroutine find_component(table, text, dim, field, component, found)
    class(field_table_type), intent(in) :: table
    character(*), intent(in) :: text
    integer, intent(in) :: dim                    !! 1, 2 or 3
    type(output_field_type), intent(out) :: field
    integer, intent(out) :: component
    logical, intent(out) :: found
    integer :: i

    component = 0
    found = .false.
    if (.not. allocated(table%fields)) return
    do i = 1, size(table%fields)
      field = table%fields(i)
      component = 0
      found = text == field%name
      if (found) return
      if (field%rank == rank_scalar) cycle
      do component = 1, field%components(dim)
        found = text == trim(field%name)//'_'//field%component_name(component, dim)
        if (found) return
      end do
    end do
    component = 0
  end subroutine find_component

end module pd_output_fields_table
